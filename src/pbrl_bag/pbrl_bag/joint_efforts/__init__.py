"""Joint efforts as a poorer substitute for a wrench: what an arm's motors say of what its hand feels."""

from pbrl_bag.joint_efforts.samples import JointSamples
from pbrl_bag.joint_efforts.stream import wrench_from_efforts

__all__ = ["JointSamples", "wrench_from_efforts"]
