"""Rooms to plan in: random offices, what is hidden in their furniture, and scenes drawn by others."""

from pbrl_namo.scenes.furniture import MAKES, Furniture, of_make
from pbrl_namo.scenes.hidden import draw_hidden, scene_yaml
from pbrl_namo.scenes.office import random_office
from pbrl_namo.scenes.settings import HiddenSettings, OfficeSettings
from pbrl_namo.scenes.svg import SvgScene, load_svg, read_svg

__all__ = [
    "MAKES",
    "Furniture",
    "HiddenSettings",
    "OfficeSettings",
    "SvgScene",
    "draw_hidden",
    "load_svg",
    "of_make",
    "random_office",
    "read_svg",
    "scene_yaml",
]
