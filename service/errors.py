"""The service's own exceptions.

::

    HybridTofError                     (simulator.errors)
    ├── InvalidInputError
    ├── RefusedError
    └── ServiceError
        ├── MalformedError             the body or a header cannot be read at all
        ├── BodyTooLargeError
        ├── SlowClientError            the head or the body does not come
        ├── UnsupportedMediaTypeError
        ├── MethodError                no such method for this resource
        ├── MisdirectedError           for a host that this is not
        ├── UnauthorizedError          without a key that is known
        ├── ForeignError               a browser sends it for a page of somebody else
        ├── NotFoundError
        ├── ConflictError              the resource is not in a state to be asked this
        ├── GoneError                  it was there, and is kept no longer
        ├── NotAcceptableError         no form that the client accepts
        ├── IdempotencyError           a key was used before with another request
        ├── OverdueError               it takes longer than the service has for it
        ├── ClientGoneError            nobody waits for the answer
        ├── BusyError                  the service takes no more work now
        ├── StoreError                 the store of jobs is locked, full or does not answer
        └── WorkerDiedError            a task killed every worker that ran it
"""

from typing import Any

from simulator.errors import HybridTofError, Problem

__all__ = [
    "BodyTooLargeError",
    "BusyError",
    "ClientGoneError",
    "ConflictError",
    "ForeignError",
    "GoneError",
    "IdempotencyError",
    "MalformedError",
    "MethodError",
    "MisdirectedError",
    "NotAcceptableError",
    "NotFoundError",
    "OverdueError",
    "ServiceError",
    "SlowClientError",
    "StoreError",
    "UnauthorizedError",
    "UnsupportedMediaTypeError",
    "WorkerDiedError",
]


class ServiceError(HybridTofError):
    """Base of what can go wrong between a client and the layers below."""


class MalformedError(ServiceError):
    """The body is not JSON, or a header or query parameter cannot be read."""


class BodyTooLargeError(ServiceError):
    """The body has more bytes than the service accepts."""


class SlowClientError(ServiceError):
    """The head or the body of the request takes too long to come."""


class UnsupportedMediaTypeError(ServiceError):
    """The body does not say that it is JSON in UTF-8, or says that it is something else.

    Attributes
    ----------
    accept : str
        The media type that is accepted.
    """

    def __init__(self, message: str, accept: str = "application/json") -> None:
        super().__init__(message)
        self.accept = accept


class MethodError(ServiceError):
    """The resource does not take this method.

    Attributes
    ----------
    allow : str
        Those that it takes, as in the header.
    """

    def __init__(self, message: str, allow: str) -> None:
        super().__init__(message)
        self.allow = allow


class MisdirectedError(ServiceError):
    """The request is for a host of another name."""


class UnauthorizedError(ServiceError):
    """The request has no API key, or none that is known."""


class ForeignError(ServiceError):
    """A browser sends the request for a page that is not of this host."""


class NotFoundError(ServiceError):
    """There is no such resource."""


class ConflictError(ServiceError):
    """The resource is not in a state in which it could answer this.

    Attributes
    ----------
    problems : tuple of Problem
        The field that is in conflict, where it is one.
    """

    def __init__(self, message: str, pointer: str | None = None) -> None:
        super().__init__(message)
        self.problems = () if pointer is None else (Problem(pointer, message),)


class GoneError(ServiceError):
    """It was there, and is kept no longer."""


class NotAcceptableError(ServiceError):
    """No form of the resource is one that the client accepts."""


class IdempotencyError(ServiceError):
    """An idempotency key came before with another request."""


class OverdueError(ServiceError):
    """The computation takes longer than the service has for an answer at once.

    Attributes
    ----------
    parts : tuple
        What it had told of its answer by then.
    """

    def __init__(self, message: str, parts: tuple[Any, ...] = ()) -> None:
        super().__init__(message)
        self.parts = parts


class ClientGoneError(ServiceError):
    """The client hung up; what it asked for was given up."""


class BusyError(ServiceError):
    """The service takes no more work at present."""


class StoreError(ServiceError):
    """The store of jobs does not take or give anything at present; what it has it keeps."""


class WorkerDiedError(ServiceError):
    """A task ended the process that ran it, every time it was tried."""
