"""Runs that take turns: a machine's clock wanders by a third for seconds at a time, and only what it does to all is fair."""


def in_turns(tasks, rounds, wanted=lambda key, results: True):
    """Calls every task once a round, beginning with another one each time; results by key.

    `tasks`: key -> function of the round. `wanted` may leave a task out, given what it and others gave so far.
    """
    results = {key: [] for key in tasks}
    keys = list(tasks)
    for turn in range(rounds):
        for key in keys[turn % len(keys):] + keys[:turn % len(keys)]:
            if wanted(key, results):
                results[key].append(tasks[key](turn))
    return results
