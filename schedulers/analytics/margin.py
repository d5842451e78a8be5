"""prototype."""

from __future__ import annotations

import os
from collections import OrderedDict, deque
from math import log, sqrt

from aerodaas.schedulers.analytics.base import *
from aerodaas.schedulers.analytics.base import MILLISECOND
from aerodaas.schedulers.analytics.estimates import ExecutionBeliefs, chance

DEPTH = int(os.environ.get("DEPTH", 3))
FORE = int(os.environ.get("FORE", 1))
MARGIN = 5 * MILLISECOND


class Lane:
    def __init__(self, profile):
        self.profile = profile
        self.tasks = deque()  # entries [task, kept]
        self.streams = OrderedDict()  # source -> [last, period, regular]
        self.waited = 1e9
        self.stolen = 1.0


class Margin(AnalyticsScheduler):
    def __init__(self):
        self.lanes = {}
        self.edge = ExecutionBeliefs(shared=False)
        self.cloud = ExecutionBeliefs(shared=True)
        self.free_at = 0
        self.rate = 0.0  # value of edge time per ns
        self.gained = 0.0
        self.spent = 0.0
        self.last_edge = 0
        self.kept = {}

    def lane(self, task):
        l = self.lanes.get(task.profile.model)
        if l is None:
            l = self.lanes[task.profile.model] = Lane(task.profile)
        return l

    # -- worth
    def alt(self, profile, slack, now):
        """Value of sending now"""
        if not self.resources.cloud_slots or profile.cloud_gain <= 0:
            return 0.0
        b = self.cloud.belief(profile, now)
        return max(0.0, profile.benefit * chance(b, slack - MARGIN / 5) - profile.cloud_cost)

    def leave_slack(self, lane, now):
        b = self.cloud.belief(lane.profile, now)
        profile = lane.profile
        w = max(1.0, profile.edge_gain - profile.cloud_gain)
        r = lane.stolen / lane.waited
        x = r * w * b.sigma * 2.5066 / profile.benefit
        z = sqrt(-2 * log(x)) if x < 0.6 else 1.0
        return b.mean + min(max(z, 1.0), 3.0) * b.sigma + MARGIN

    def task_arrived(self, task, now):
        lane = self.lane(task)
        s = lane.streams.get(task.source)
        if s is None:
            lane.streams[task.source] = [now, 0, 0]
        else:
            gap = now - s[0]
            s[2] = s[2] + 1 if abs(gap - s[1]) < 0.05 * gap else 0
            s[0], s[1] = now, gap
            lane.streams.move_to_end(task.source)
        lane.tasks.append(task)
        if self.alt(task.profile, task.deadline - now, now) > 0:
            at = int(max(now, task.deadline - self.leave_slack(lane, now)))
            if at <= now:
                return list(self.leave(lane, task, now))
            return [WakeAt(at)]
        return [WakeAt(self.last_start(task, now))]

    def last_start(self, task, now):
        b = self.edge.belief(task.profile, now)
        return int(max(now + 1, task.deadline - b.mean + b.sigma))

    def timer(self, now):
        out = []
        for lane in self.lanes.values():
            if not lane.tasks:
                continue
            slack = self.leave_slack(lane, now)
            for task in list(lane.tasks):
                if task in self.kept or self.alt(task.profile, task.deadline - now, now) <= 0:
                    b = self.edge.belief(task.profile, now)
                    if task.deadline - now <= b.mean - b.sigma + 1:
                        lane.tasks.remove(task)
                        self.kept.pop(task, None)
                        out.append(Drop(task, "no time left on the edge"))
                    elif task.deadline - b.mean + b.sigma > now:
                        pass
                elif task.deadline - now <= slack + 1:
                    out.extend(self.leave(lane, task, now))
                else:
                    break
        return out

    def leave(self, lane, task, now):
        if task in self.plan(max(self.free_at, now), now, task)[1]:
            self.kept[task] = True
            return [WakeAt(self.last_start(task, now))]
        lane.tasks.remove(task)
        lane.waited += now - task.arrival
        return [
            SendToCloud(
                task,
                "worth more in the cloud",
                task.deadline - int(self.cloud.belief(task.profile, now).mean),
            )
        ]

    def plan(self, t0, now, focus=None):
        """-> best score, list of (task or None)"""
        lanes = []
        for lane in self.lanes.values():
            profile = lane.profile
            b = self.edge.belief(profile, now)
            c = max(0.0, profile.cloud_gain)
            items = []
            for task in lane.tasks:
                a = 0.0 if task in self.kept else self.alt(profile, task.deadline - now, now)
                if task.deadline - t0 > b.mean - b.sigma:
                    items.append(
                        (
                            t0,
                            task.deadline,
                            profile.edge_gain + profile.edge_cost,
                            profile.edge_cost + a,
                            task,
                        )
                    )
            if FORE:
                k = 0
                for last, period, regular in lane.streams.values():
                    if regular < 2:
                        continue
                    at = last + period
                    if at < now - 20 * MILLISECOND:
                        continue
                    at = max(at, now + 1)
                    if at > t0 + 800 * MILLISECOND or k >= 3:
                        break
                    a = self.alt(profile, profile.deadline, now)
                    items.append(
                        (at, at + profile.deadline, profile.benefit, profile.edge_cost + a, None)
                    )
                    k += 1
            if items:
                lanes.append((b, items))
        rho = self.rate
        best = [0.0, []]
        n = len(lanes)
        idx = [0] * n
        chosen = []

        def go(t, score, depth):
            for li in range(n):
                b, items = lanes[li]
                i0 = idx[li]
                mean = b.mean
                lim = t + mean - b.sigma
                i = i0
                while i < len(items) and items[i][1] < lim:
                    i += 1
                if i == len(items):
                    continue
                start, deadline, benefit, cost, task = items[i]
                s = max(t, start)
                end = s + mean
                g = benefit * chance(b, deadline - s) - cost
                if g <= 0:
                    continue
                sc = score + g - rho * (end - t)
                chosen.append((s, task))
                if sc > best[0]:
                    best[0] = sc
                    best[1] = list(chosen)
                if depth > 1:
                    idx[li] = i + 1
                    go(end, sc, depth - 1)
                    idx[li] = i0
                chosen.pop()

        go(t0, 0.0, DEPTH)
        return best[0], [t for _, t in best[1]], best[1]

    def executor_idle(self, now):
        score, tasks, seq = self.plan(now, now)
        if not seq:
            return ()
        s, task = seq[0]
        if task is None:
            return [WakeAt(int(s))] if s > now else ()
        lane = self.lane(task)
        lane.tasks.remove(task)
        lane.waited += now - task.arrival
        lane.stolen += 1
        b = self.edge.belief(task.profile, now)
        a = 0 if self.kept.pop(task, None) else self.alt(task.profile, task.deadline - now, now)
        gain = task.profile.benefit * chance(b, task.deadline - now) - task.profile.edge_cost - a
        # average gain per elapsed time
        dt = now + b.mean - self.last_edge
        self.last_edge = now + b.mean
        self.gained = self.gained * 0.98 + gain
        self.spent = self.spent * 0.98 + dt
        self.rate = self.gained / self.spent * float(os.environ.get("RHO", 1))
        self.free_at = now + b.mean
        return [RunOnEdge(task, "best plan")]

    def task_finished(self, result, now):
        if result.place is Place.EDGE:
            self.free_at = now
            self.edge.observe(result.task.profile, result.finished - result.started, now)
        elif result.place is Place.CLOUD and result.outcome is not Outcome.TIMEOUT:
            self.cloud.observe(result.task.profile, result.finished - result.started, now)
        return ()
