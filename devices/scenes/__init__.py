"""Close-up scenes of a blade with exactly known truth: what the eye is measured on, apart from any flight."""

from devices.scenes.blade import BladePiece
from devices.scenes.draw import Scene, draw_scene
from devices.scenes.settings import SceneSettings, random_settings
from devices.scenes.truth import SceneTruth

__all__ = ["BladePiece", "Scene", "SceneSettings", "SceneTruth", "draw_scene", "random_settings"]
