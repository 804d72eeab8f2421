import pickle

from roboprompt_client.errors import ServiceProblemError


def test_a_problem_can_be_raised_by_a_worker_process():
    problem = {"type": "/problems/model-busy", "title": "Busy", "detail": "ask later"}
    again = pickle.loads(pickle.dumps(ServiceProblemError(503, problem)))
    assert (again.status, again.problem, str(again)) == (503, problem, "503 Busy: ask later")
