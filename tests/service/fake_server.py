"""A server whose posteriors are `fake_fold`; arguments: its orders as JSON, largest body."""

import json
import os
import sys

from service.app import create_app
from service.server import server_of
from service.service_settings import ServiceSettings
from tests.service import fake_fold

# guarded: the workers import their parent's main module
if __name__ == "__main__":
    fake_fold.order(**json.loads(sys.argv[1]))
    environment = ServiceSettings.from_environment(os.environ)
    settings = environment.model_copy(update={"workers": 2, "max_body_bytes": int(sys.argv[2])})
    app = create_app(settings, fake_fold)
    server_of(app, settings, port=0).run()
