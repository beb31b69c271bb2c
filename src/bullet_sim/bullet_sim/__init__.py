"""What the simulators share: Bullet client, scene, casters, grip, sensors, concealed effects."""

from bullet_sim.clamp import Clamp, ClampTest, GripperSpec, find_clamp
from bullet_sim.client import GRAVITY, STEP, BulletClient, Pose, Twist
from bullet_sim.errors import SimError
from bullet_sim.grip import Grip, GripLoad
from bullet_sim.scene import Scene, load_scene
from bullet_sim.world import BodyTruth, World

__all__ = [
    "GRAVITY",
    "STEP",
    "BodyTruth",
    "BulletClient",
    "Clamp",
    "ClampTest",
    "Grip",
    "GripLoad",
    "GripperSpec",
    "Pose",
    "Scene",
    "SimError",
    "Twist",
    "World",
    "find_clamp",
    "load_scene",
]
