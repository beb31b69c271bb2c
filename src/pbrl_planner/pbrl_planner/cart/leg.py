"""From a goal to its end: when to plan, when to drive, when to try again. A table without ROS; time is given."""

from __future__ import annotations

from enum import StrEnum

from pbrl_control.cart import DriveStatus
from pbrl_planner.cart.query import Outcome
from pbrl_planner.cart.settings import NavigationSettings


class LegState(StrEnum):
    """What is going on."""

    PLANNING = "planning"
    DRIVING = "driving"
    WAITING = "waiting"
    ARRIVED = "arrived"
    FAILED = "failed"


class Drove(StrEnum):
    """How a drive along a path ended."""

    ARRIVED = "arrived"
    REPLAN = "given up; plan again"
    GRIP_LOST = "the cart is not held as it should be"
    REFUSED = "no path that can be driven"
    STOPPED = "stopped"


ENDS = {
    DriveStatus.ARRIVED: Drove.ARRIVED,
    DriveStatus.REPLAN: Drove.REPLAN,
    DriveStatus.FAILED: Drove.GRIP_LOST,
}
"""What a drive ends with by the controller's status; with others it goes on."""


class Order(StrEnum):
    """What is to be done now."""

    NOTHING = ""
    PLAN = "ask the planner"
    CLEAR = "clear the costmaps where robot and cart are"
    FORGET = "forget what nobody has seen of late"
    REFINE = "ask the planner for a better path from a place ahead"
    FOLLOW = "drive along the path"
    SWITCH = "drive on to that place, and along the better path from there"
    GO_ON = "drive on along what is left of the path that was given up, as soon as it is free"
    BACK = "go back along where robot and cart came"
    END = "say how it ended"


ENDED = (LegState.ARRIVED, LegState.FAILED)
HOPELESS = (Outcome.GOAL_OFF_MAP, Outcome.START_OFF_MAP)
"""What no patience mends."""


class Leg:
    """One goal.

    Args:
        settings: when to plan again, and when to give up.
        now: [s].

    Attributes:
        state: what is going on.
        sentence: the same, and why, for a person.
        plans: calls of the planner that were answered.
        failures: those that found no path.
        began: [s].
    """

    def __init__(self, settings: NavigationSettings, now: float) -> None:
        self._settings = settings
        self.began = now
        self.state, self.sentence = LegState.PLANNING, "looking for a path"
        self.plans = self.failures = 0
        self._asked = self._driving = self._stands = self._refining = self._backing = self._left = False
        self._since = now  # on this path
        self._next, self._pause = now, settings.retry
        self._without: float | None = None
        self._stuck: float | None = None

    def tick(self, now: float) -> Order:
        """Return what is due now."""
        if self.state in ENDED or self._asked or self._driving or now < self._next:
            return Order.NOTHING
        return self._ask()

    def planned(self, now: float, outcome: Outcome, message: str) -> Order:
        """Take in the planner's answer."""
        refining, self._asked, self._refining = self._refining, False, False
        if self.state in ENDED:
            return Order.NOTHING
        self.plans += 1
        if refining:
            return self._refined(now, outcome)
        if outcome is Outcome.FOUND:
            self._next, self._pause = now + self._settings.retry, self._settings.retry
            if self._driving and not self._stands:  # who was in the way is gone, and the path begins behind the robot
                return Order.NOTHING
            self._without, self._driving, self._stands, self._left, self._since = None, True, False, False, now
            return self._say(LegState.DRIVING, message, Order.FOLLOW)
        self.failures += 1
        self._next, self._pause = now + self._pause, min(2.0 * self._pause, self._settings.retry_most)
        if outcome in HOPELESS:
            return self._say(LegState.FAILED, message, Order.END)
        self._stuck = now if self._stuck is None else self._stuck
        self._without = now if self._without is None else self._without
        if now - self._stuck > self._settings.make_way:
            self._stuck, self._driving, self._stands, self._left, self._backing = None, True, False, False, True
            return self._say(LegState.DRIVING, f"going back to make way; {message}", Order.BACK)
        if now - self._without > self._settings.give_up:
            words = f"no path for {now - self._without:.0f} s; {message}"
            return self._say(LegState.FAILED, words, Order.END)
        # What is marked where the robot stands may never have been there; what is there is soon seen again.
        order = Order.CLEAR if outcome is Outcome.START_OCCUPIED else Order.FORGET
        if self._left and order is Order.FORGET:
            self._left, self._driving, self._stands, self._since = False, True, True, now
            return self._say(LegState.DRIVING, f"stands before something; {message}", Order.GO_ON)
        if self._driving:
            self.sentence = f"stands before something; {message}"
            return order
        return self._say(LegState.WAITING, message, order)

    def driving(self, now: float, blocked: float, reason: str) -> Order:
        """Take in how the drive goes on: for how long it has stood before something [s], and why it is slow."""
        if self.state is not LegState.DRIVING or self._backing:
            return Order.NOTHING
        self._stands = blocked > 0.0
        self.sentence = reason if reason and self._stands else "on the way"
        if self._asked or now < self._next:
            return Order.NOTHING
        if blocked >= self._settings.blocked:
            return self._ask()
        if self._stands or now - self._since < self._settings.refresh:
            return Order.NOTHING
        self._refining = self._asked = True
        return Order.REFINE

    def _refined(self, now: float, outcome: Outcome) -> Order:
        """Switch to what was found ahead; where nothing was, the path that is driven is as good as before."""
        self._since = now
        if outcome is not Outcome.FOUND:
            self.failures += 1
        return Order.SWITCH if self._driving and outcome is Outcome.FOUND else Order.NOTHING

    def nothing_ahead(self, now: float) -> None:
        """Take in that no better path can be asked for: too little is left of the one that is driven."""
        self._asked = self._refining = False
        self._since = now

    def got_on(self) -> None:
        """Take in that there is headway: paths that are found and shut again at once are none."""
        self._stuck = self._without = None

    def forgot(self, now: float) -> None:
        """Take in that something was taken out of the costmaps: there may be a path soon."""
        self._pause = self._settings.retry
        self._next = min(self._next, now + self._pause)

    def nothing_behind(self) -> None:
        """Take in that there is no way back: robot and cart have not come from anywhere."""
        self._backing = self._driving = False
        self.state = LegState.WAITING

    def drove(self, now: float, ended: Drove, message: str) -> Order:
        """Take in how the drive ended; not for one whose place another path has taken."""
        backing, self._backing, self._driving = self._backing, False, False
        if self.state in ENDED:
            return Order.NOTHING
        if backing and ended in (Drove.ARRIVED, Drove.REPLAN):
            self._next, self._without = now + self._settings.room, None
            # Where that was not far enough, it goes on soon.
            self._stuck = now - self._settings.make_way + 2.0 * self._settings.room
            order = Order.CLEAR if ended is Drove.REPLAN else Order.NOTHING
            return self._say(LegState.WAITING, "waiting for who wants to get by", order)
        if ended is Drove.ARRIVED:
            return self._say(LegState.ARRIVED, "at the goal", Order.END)
        if ended is Drove.REPLAN:
            # While there is no other path the way on this one may get free.
            self._left, self._next = True, min(self._next, now)
            return self._say(LegState.WAITING, message, Order.CLEAR)
        return self._say(LegState.FAILED, message or str(ended), Order.END)

    @property
    def backing(self) -> bool:
        """Whether robot and cart go back to make way."""
        return self._backing

    @property
    def asked(self) -> bool:
        """Whether the planner has not answered yet."""
        return self._asked and self.state not in ENDED

    def refuse(self, sentence: str) -> None:
        """Fail: it is no goal, or nobody wants it any more."""
        self.state, self.sentence = LegState.FAILED, sentence

    def _ask(self) -> Order:
        self._asked = True
        if not self._driving:
            self.state = LegState.PLANNING
        return Order.PLAN

    def _say(self, state: LegState, sentence: str, order: Order) -> Order:
        self.state, self.sentence = state, sentence
        return order
