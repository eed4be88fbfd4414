"""What the techniques need, what they are immune to, what they cost."""

from fastapi import APIRouter
from pydantic import BaseModel

from service.answers.techniques import TechniquesResponse, all_techniques

__all__ = ["router"]

router = APIRouter(prefix="/v1/techniques", tags=["techniques"])


@router.get("", response_model=TechniquesResponse)
async def techniques() -> BaseModel:
    """List the techniques."""
    return all_techniques()
