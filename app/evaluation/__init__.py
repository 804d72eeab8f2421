"""The evaluation: teaches tasks over HTTP, predicts and executes actions in unseen scenes, judges and reports them."""
