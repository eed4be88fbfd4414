# syntax=docker/dockerfile:1
# docker build -t hybridtof .                          the service
# docker build --target test .                         runs the suite
# compose.yaml runs it: on loopback, with a key
# docker build --build-arg BASE=my/debian-with-python  any base with python3 >= 3.11 and venv
ARG BASE=python:3.13-slim

FROM ${BASE} AS base
ENV PYTHONDONTWRITEBYTECODE=1 \
    PYTHONUNBUFFERED=1 \
    PIP_NO_CACHE_DIR=1 \
    PIP_DISABLE_PIP_VERSION_CHECK=1 \
    PATH=/opt/hybridtof/bin:$PATH

FROM base AS build
RUN python3 -m venv /opt/hybridtof
WORKDIR /build
COPY requirements/ requirements/
RUN pip install --require-hashes -r requirements/runtime.txt
# the build backend, in the locked version and in an environment that is thrown away
RUN python3 -m venv /opt/backend \
    && sed -n '/^setuptools==/,/[^\\]$/p' requirements/dev.txt > backend.txt \
    && /opt/backend/bin/pip install --require-hashes -r backend.txt
COPY pyproject.toml README.md LICENSE ./
COPY hybridtof/ hybridtof/
COPY simulator/ simulator/
COPY inference/ inference/
COPY service/ service/
RUN /opt/backend/bin/pip wheel --no-deps --no-build-isolation --wheel-dir wheels . \
    && pip install --no-deps wheels/*.whl

FROM build AS test
RUN pip install --require-hashes -r requirements/dev.txt
RUN useradd --uid 10001 --create-home tester
COPY --chown=tester . .
RUN pip install --no-deps --no-build-isolation --editable . && chown tester /build
USER tester
RUN python -m pytest -n 2 --dist loadgroup --no-loadscope-reorder

FROM base AS runtime
RUN useradd --uid 10001 --no-create-home --shell /usr/sbin/nologin hybridtof \
    && install -d -m 700 -o hybridtof /var/cache/hybridtof /var/lib/hybridtof /var/lib/tls
COPY --from=build /opt/hybridtof /opt/hybridtof
# machine code of the kernels is part of the image: for any processor of its kind
# jobs: for as long as the volume, or where HYBRIDTOF_DATABASE says
ENV NUMBA_CACHE_DIR=/var/cache/hybridtof \
    NUMBA_CPU_NAME=generic \
    NUMBA_CPU_FEATURES="" \
    HYBRIDTOF_DATABASE=sqlite:////var/lib/hybridtof/jobs.sqlite
VOLUME /var/lib/hybridtof
USER hybridtof
RUN hybridtof warm
EXPOSE 8000
HEALTHCHECK --interval=10s --timeout=5s --start-period=30s \
    CMD ["python3", "-c", "import urllib.request as r; r.urlopen('http://127.0.0.1:8000/health/live', timeout=4)"]
ENTRYPOINT ["hybridtof"]
CMD ["serve", "--host", "0.0.0.0", "--port", "8000"]
