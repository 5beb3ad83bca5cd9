"""What a second thread is worth, and what a second core: threads.py PROGRAM STATE OUT."""

import csv
import pathlib
import statistics
import subprocess
import sys

ROUNDS = 7
SECONDS = {"uniform": "0.4", "multirate": "0.25"}  # simulated, so that a run takes a second or two


def start(program, state, method, threads):
    command = [program, state, "--method", method, "--threads", str(threads), "--seconds", SECONDS[method]]
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True)


def result(process):
    """(seconds, contact evaluations, ball updates, checksum)"""
    text, _ = process.communicate()
    if process.returncode != 0:
        sys.exit(f"threads.py: {' '.join(process.args)} ended with exit code {process.returncode}")
    seconds, evaluations, updates, bits = text.split()
    return float(seconds), int(evaluations), int(updates), bits


def measure(program, state, method):
    """One round: seconds of one thread, of two, and the mean of two independent processes at once."""
    one = result(start(program, state, method, 1))
    two = result(start(program, state, method, 2))
    both = [start(program, state, method, 1) for _ in range(2)]
    apart = [result(process) for process in both]
    if one[3] != two[3]:
        sys.exit(f"threads.py: {method}: two threads end elsewhere than one ({two[3]} and {one[3]})")
    return one[0], two[0], statistics.mean(seconds for seconds, *_ in apart), one


def main():
    program, state, out = sys.argv[1:]
    rows, example = [], {}
    for turn in range(ROUNDS):
        for method in SECONDS:
            one, two, apart, example[method] = measure(program, state, method)
            rows.append((turn, method, one, two, apart, one / two, 2 * one / apart))
    pathlib.Path(out).mkdir(parents=True, exist_ok=True)
    with open(pathlib.Path(out) / "threads.csv", "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["round", "method", "one_thread_s", "two_threads_s", "two_processes_s", "two_threads", "two_processes"])
        writer.writerows(rows)
    per = {}
    for method in SECONDS:
        mine = [row for row in rows if row[1] == method]
        middle = [statistics.median(row[k] for row in mine) for k in range(2, 7)]
        per[method] = middle[0] / example[method][1]
        print(f"{method}: two threads {middle[3]:.2f} times one; two independent processes {middle[4]:.2f} times one; same bits")
    print(f"seconds per contact evaluation, multirate over uniform, one thread: {per['multirate'] / per['uniform']:.2f}")
    print(f"medians of {ROUNDS} rounds in turn; all in {out}/threads.csv")


if __name__ == "__main__":
    main()
