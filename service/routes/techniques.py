"""What the techniques need, what they are immune to, what they cost."""

from fastapi import APIRouter

from inference.techniques import ALL_TECHNIQUES
from service.schemas import TechniqueDescription, TechniquesResponse

__all__ = ["router"]

router = APIRouter(prefix="/v1/techniques", tags=["techniques"])


@router.get("")
async def techniques() -> TechniquesResponse:
    """List the techniques."""
    return TechniquesResponse(
        techniques=[
            TechniqueDescription(
                name=technique.name,
                kinds=list(technique.kinds),
                observables=technique.observables,
                needs=list(technique.needs),
                immune_to=list(technique.immune_to),
                uses_background=technique.uses_background,
                differential=technique.differential,
                cost=technique.cost,
                equations=technique.equations,
                roots=technique.roots,
            )
            for technique in ALL_TECHNIQUES.values()
        ]
    )
