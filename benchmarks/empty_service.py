"""The baseline of the service over HTTP: a FastAPI endpoint that does nothing, on the same server.

python -m benchmarks.empty_service
"""

import uvicorn
from fastapi import FastAPI

app = FastAPI()


@app.get("/health/live")
async def live() -> dict[str, str]:
    return {}


@app.post("/v1/estimates")
async def estimates() -> dict[str, str]:
    return {}


if __name__ == "__main__":
    uvicorn.run(app, port=0, access_log=False)
