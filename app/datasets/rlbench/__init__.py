"""Folders that RLBench's and PerAct's dataset generators write, without RLBench."""
