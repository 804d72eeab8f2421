"""Which replica should a task's predictions go to? A simulation of prefix caches behind a router.

`python -m benchmarks.replicas`. Each replica keeps the prefixes of the last tasks that it served (as llama.cpp and vLLM
do, least recently used out first). Tasks are asked with Zipf's frequencies. A hit evaluates the query only, a miss the
whole prompt: 33 and 2,174 tokens for Gemma 3 270M with ten demonstrations.
"""

import hashlib
import random
import sys
from collections import Counter, OrderedDict

TASKS, REPLICAS, PREFIXES, REQUESTS = 1_000, 16, 50, 60_000
HIT_TOKENS, MISS_TOKENS = 33, 2_174
ZIPF = 1.0


def score(task, replica):
    return hashlib.sha256(f"{task} {replica}".encode()).digest()


def rendezvous(task, replicas, _):
    """The replica with the highest hash of task and name: when one goes, only its tasks move."""
    return max(replicas, key=lambda replica: score(task, replica))


def modulo(task, replicas, _):
    return replicas[int.from_bytes(hashlib.sha256(str(task).encode()).digest()[:8], "big") % len(replicas)]


def at_random(_, replicas, rng):
    return rng.choice(replicas)


def bounded_rendezvous(factor):
    """Rendezvous, but past replicas that have more than `factor` times the average load of the last requests."""

    def choose(task, replicas, _, recent):
        limit = factor * max(1, sum(recent.values()) / len(replicas))
        ranked = sorted(replicas, key=lambda replica: score(task, replica), reverse=True)
        return next((replica for replica in ranked if recent[replica] < limit), ranked[0])

    return choose


class Cache:
    """The prefixes of one replica."""

    def __init__(self):
        self._tasks = OrderedDict()

    def asked(self, task):
        """Whether the task's prefix was there; it is now."""
        hit = task in self._tasks
        self._tasks[task] = None
        self._tasks.move_to_end(task)
        if len(self._tasks) > PREFIXES:
            self._tasks.popitem(last=False)
        return hit


def simulate(choose, lose_one=False, seed=0):
    """(hit rate, prompt tokens a request, busiest replica's load over the average, hit rate just after a loss)."""
    rng = random.Random(seed)
    names = list(range(REPLICAS))
    caches = {name: Cache() for name in names}
    weights = [1 / (rank + 1) ** ZIPF for rank in range(TASKS)]
    asked = rng.choices(range(TASKS), weights, k=REQUESTS)
    hits, load, after_loss, window, recent = 0, Counter(), [], [], Counter()
    bounded = choose.__name__ == "choose"
    for k, task in enumerate(asked):
        if lose_one and k == REQUESTS // 2:
            names = names[1:]
        replica = choose(task, names, rng, recent) if bounded else choose(task, names, rng)
        window.append(replica)
        recent[replica] += 1
        if len(window) > 1000:
            recent[window.pop(0)] -= 1
        hit = caches[replica].asked(task)
        hits += hit
        load[replica] += 1
        if REQUESTS // 2 <= k < REQUESTS // 2 + 5_000:
            after_loss.append(hit)
    rate = hits / REQUESTS
    tokens = rate * HIT_TOKENS + (1 - rate) * MISS_TOKENS
    return rate, tokens, max(load.values()) / (REQUESTS / REPLICAS), sum(after_loss) / len(after_loss)


def main():
    say = sys.stdout.write
    say(f"{TASKS} tasks, {REPLICAS} replicas, {PREFIXES} prefixes each, Zipf {ZIPF}\n\n")
    say("| route | prefix found | prompt tokens a request | busiest / average | found after one replica is lost |\n")
    say("| --- | --- | --- | --- | --- |\n")
    routes = {
        "at random": at_random,
        "hash modulo": modulo,
        "rendezvous": rendezvous,
        "rendezvous, load at most 1.5 times the average": bounded_rendezvous(1.5),
        "rendezvous, load at most 1.25 times the average": bounded_rendezvous(1.25),
    }
    for name, choose in routes.items():
        rate, tokens, busiest, _ = simulate(choose)
        *_, after = simulate(choose, lose_one=True)
        say(f"| {name} | {rate:.1%} | {tokens:.0f} | {busiest:.2f} | {after:.1%} |\n")


if __name__ == "__main__":
    main()
