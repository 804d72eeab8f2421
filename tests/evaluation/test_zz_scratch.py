import json, pytest
from tests.evaluation.test_composition import *
@pytest.mark.parametrize("task",["swap_cubes","clear_kind"])
def test_prompt(service, tmp_path, task):
    solver,_=service
    (m,)=chosen(SWEEP.with_models([MODEL]),["parts"],[])
    r=run(solver,tmp_path,task,(m,),10)
    for t in r.trials:
        json.dump([t.answer["prompt"], [(x["code"],x["severity"]) for x in t.answer["findings"]], t.succeeded], open(f"/tmp/parts/prompt_{task}.json","w"))
