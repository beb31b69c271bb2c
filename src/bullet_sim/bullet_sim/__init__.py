"""What the simulators share: Bullet client, scene, casters, grip, sensors, concealed effects, a hand that pushes."""

from bullet_sim.clamp import Clamp, ClampTest, GripperSpec, find_clamp
from bullet_sim.client import GRAVITY, STEP, BulletClient, Pose, Twist
from bullet_sim.concealed.options import EFFECTS, Concealed
from bullet_sim.errors import SimError
from bullet_sim.grip import Grip, GripLoad
from bullet_sim.hand import Hand, HandSpec
from bullet_sim.hand_push import push_by_hand
from bullet_sim.hand_recording import Activity, HandPath, HandPush, HandRecording
from bullet_sim.scene import Scene, load_scene
from bullet_sim.world import BodyTruth, World

__all__ = [
    "EFFECTS",
    "GRAVITY",
    "STEP",
    "Activity",
    "BodyTruth",
    "BulletClient",
    "Clamp",
    "ClampTest",
    "Concealed",
    "Grip",
    "GripLoad",
    "GripperSpec",
    "Hand",
    "HandPath",
    "HandPush",
    "HandRecording",
    "HandSpec",
    "Pose",
    "Scene",
    "SimError",
    "Twist",
    "World",
    "find_clamp",
    "load_scene",
    "push_by_hand",
]
