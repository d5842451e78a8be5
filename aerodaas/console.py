"""stub"""


class Starting:
    def __init__(self, o):
        pass

    def __enter__(self):
        return self

    def __exit__(self, *a):
        pass

    def step(self, t):
        print("..", t)


class Watching:
    def __init__(self, *a):
        self.n = 0

    def __enter__(self):
        return self

    def __exit__(self, *a):
        pass

    def update(self, s):
        self.n += 1
        if self.n % 5 == 0:
            for k, r in s.robots.items():
                print(
                    k,
                    r.status.state.value,
                    r.status.target.id if r.status.target else None,
                    [round(float(x), 2) for x in r.state.odometry.position],
                    r.status.stamp / 1e9,
                    {n: p.phase for n, p in s.reports.items()},
                )
            for a in s.alerts:
                print("  ALERT", a.text)


def show_results(o, rec, state, reports, wall):
    print("wall", wall, rec)
    for n, r in reports.items():
        print(
            n,
            r.phase,
            r.error,
            {k: (c.received, c.dropped) for k, c in r.streams.items() if c.received},
            r.sent,
            r.cpu_seconds,
            r.values,
        )
