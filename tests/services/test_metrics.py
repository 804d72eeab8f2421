from app.services.measures import MAX_MODELS, Metrics


def test_names_of_models_do_not_become_any_number_of_labels():
    metrics = Metrics()
    for k in range(MAX_MODELS + 20):
        metrics.observe_prediction(f"openai/m{k}", "absolute", "ok", {"total": 1.0}, {"prompt_tokens": 1})
        metrics.observe_outcome(f"openai/m{k}", success=True)
    lines = [line for line in metrics.text().decode().splitlines() if line.startswith("roboprompt_predictions_total")]
    assert len(lines) == MAX_MODELS + 1
    assert 'roboprompt_predictions_total{model="other",representation="absolute",status="ok"} 20.0' in lines
