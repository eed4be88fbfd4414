"""What an answer supposes that no reading can test, and that moves ranges where it is wrong."""

from simulator.scene import Scene

__all__ = ["assumptions_of"]

_OWN_SHADOW = (
    'the shadow is taken for the object\'s own (c0\' = c0, c1\' = c1), as "shadow": "object" says. '
    "That of a diffuse object has c0' near 0.75 c0, and ranges are then off without a misfit: "
    "leave `shadow` out to have it unknown, or state its c0 and c1"
)


def assumptions_of(scene: Scene) -> tuple[str, ...]:
    """Return what answers about a scene suppose without a check.

    Parameters
    ----------
    scene : Scene
        The scene.

    Returns
    -------
    tuple of str
        For a person; empty where everything is either stated in numbers or unknown.
    """
    return (_OWN_SHADOW,) if scene.shadow_is_object else ()
