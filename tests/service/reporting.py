"""What tests of the report share: its scenes by name, and a small effort."""

from service.report.cells import Effort
from service.report.scenes import SCENES

BY_NAME = {scene.name: scene for scene in SCENES}

TINY = Effort(200, 4, 2, (40,), (10,), (), (), (2,))
