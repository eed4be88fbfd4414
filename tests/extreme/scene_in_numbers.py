"""A scene in which every number is known, but where a technique needs none, as a document."""

import dataclasses

__all__ = ["SceneInNumbers"]


@dataclasses.dataclass(frozen=True, kw_only=True)
class SceneInNumbers:
    """Object, background and gain, before a technique is asked."""

    technique: str
    gain: float
    c0: float
    c1: float
    c2: float
    distance: float
    strength: float
    c0s: float
    c1s: float

    @property
    def document(self) -> dict[str, object]:
        scene: dict[str, object] = {
            "object": {"c0": self.c0, "c1": self.c1, "c2": self.c2},
            "discrepancy": 0,
        }
        if self.technique.startswith("background"):
            known = self.technique != "background_cancelling"
            prior = {"prior": "lognormal", "median": self.strength, "sigma": 1.0}
            scene["background"] = {
                "strength": self.strength if known else prior,
                "distance_m": self.distance,
                "shadow": {"c0": self.c0s, "c1": self.c1s},
            }
        return scene
