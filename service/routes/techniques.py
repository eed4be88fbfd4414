"""What the real-time techniques need, what they are immune to, what they cost."""

from fastapi import APIRouter

from inference.realtime.registry import TECHNIQUES
from service.schemas import TechniqueDescription, TechniquesResponse

__all__ = ["router"]

router = APIRouter(prefix="/v1/techniques", tags=["techniques"])


@router.get("")
async def techniques() -> TechniquesResponse:
    """List the techniques."""
    return TechniquesResponse(techniques=[TechniqueDescription(name=name) for name in TECHNIQUES])
