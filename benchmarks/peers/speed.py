"""Ball-steps per second, at rest and in flow, with each peer at the best skin of its neighbour lists."""

from dataclasses import dataclass
from statistics import median

from command import Settings
from turns import in_turns

STEP = 8e-5    # s: all are stable there, and a longer step only makes lists age faster


@dataclass(frozen=True)
class Speed:
    """Ball-steps per second of a code on a case; content balls count, wall and plug do not."""
    case: str
    threads: int
    code: str
    kernels: str         # of grainclock; "" for peers
    skin: float | None   # m, of peers
    rates: tuple

    def rate(self):
        return median(self.rates)


def best_skin(peer, case, step, steps, skins, folder):
    """Of `skins` [m] the one with the least time for some steps, tried on one core."""
    seconds = {skin: peer.run(case, Settings(step, steps, skin), folder).seconds for skin in skins}
    return min(seconds, key=seconds.get)


def speeds(cases, builds, peers, skins, threads, steps, rounds, folder_of):
    """`skins`: (peer's name, case's name) -> m; `steps` of a timed run, of which slow codes do their share."""
    tasks = {}
    for case in cases:
        for count in threads:
            for build in builds:
                tasks[case.name, count, "grainclock", build.name, None] = (
                    lambda turn, c=case, n=count, b=build: b.speed(c, Settings(STEP, steps, 0.0, n), folder_of(c, "grainclock")))
            for peer in peers:
                skin = skins[peer.name, case.name]
                settings = Settings(STEP, max(1, int(steps * peer.share)), skin, count)
                tasks[case.name, count, peer.name, "", skin] = (
                    lambda turn, c=case, p=peer, s=settings: rate_of(p, c, s, folder_of(c, p.name)))
    return [Speed(*key, tuple(rates)) for key, rates in in_turns(tasks, rounds).items()]


def rate_of(peer, case, settings, folder):
    return case.balls() * settings.steps / peer.run(case, settings, folder).seconds
