# syntax=docker/dockerfile:1
# docker build -t hybridtof .                          the service
# docker build --target test .                         runs the suite
# make container-test                                  both, and the image's first answer
# compose.yaml runs it: on loopback, with a key
# docker build --build-arg BASE=my/debian-with-python  any base with python3 >= 3.11 and venv
# docker build --secret id=pip,src=/etc/pip.conf       where pip needs settings: in no layer
ARG BASE=python:3.13-slim

FROM ${BASE} AS base
ENV PYTHONDONTWRITEBYTECODE=1 \
    PYTHONUNBUFFERED=1 \
    PIP_NO_CACHE_DIR=1 \
    PIP_DISABLE_PIP_VERSION_CHECK=1 \
    PATH=/opt/hybridtof/bin:$PATH

FROM base AS build
# what installs stays behind: the environment that is kept has no pip and no build backend
RUN python3 -m venv /opt/build && python3 -m venv --without-pip /opt/hybridtof
WORKDIR /build
COPY requirements/ requirements/
RUN --mount=type=secret,id=pip,target=/etc/pip.conf \
    /opt/build/bin/pip --python /opt/hybridtof/bin/python install --require-hashes -r requirements/runtime.txt
# the build backend in its locked version
RUN --mount=type=secret,id=pip,target=/etc/pip.conf \
    sed -n '/^setuptools==/,/[^\\]$/p' requirements/dev.txt > backend.txt \
    && /opt/build/bin/pip install --require-hashes -r backend.txt
COPY pyproject.toml README.md LICENSE ./
COPY hybridtof/ hybridtof/
COPY simulator/ simulator/
COPY inference/ inference/
COPY service/ service/
RUN /opt/build/bin/pip wheel --no-deps --no-build-isolation --wheel-dir wheels . \
    && /opt/build/bin/pip --python /opt/hybridtof/bin/python install --no-deps wheels/*.whl

FROM build AS test
# every process of the tests would compile all that it imports
ENV PYTHONDONTWRITEBYTECODE=""
# of pytest -m: "not slow" for the tests that take seconds, left out for all
ARG MARKS=""
RUN --mount=type=secret,id=pip,target=/etc/pip.conf \
    /opt/build/bin/pip --python /opt/hybridtof/bin/python install --require-hashes -r requirements/dev.txt
RUN useradd --uid 10001 --create-home tester
COPY --chown=tester . .
RUN /opt/build/bin/pip --python /opt/hybridtof/bin/python install --no-deps --no-build-isolation --editable . \
    && chown tester /build
USER tester
# with the processor time, which tells more than the clock of a busy machine
RUN python -m pytest -n 2 --dist loadscope --no-loadscope-reorder -m "${MARKS}" && times

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
    CMD ["python3", "-c", "import urllib.request as r; r.urlopen('http://127.0.0.1:8000/health/ready', timeout=4)"]
ENTRYPOINT ["hybridtof"]
CMD ["serve", "--host", "0.0.0.0", "--port", "8000"]
