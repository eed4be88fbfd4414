"""A server whose posteriors are `fake_fold`; arguments: its orders as JSON, largest body."""

# guarded: the workers run their parent's main module, and need none of what the service needs
if __name__ == "__main__":
    import json
    import os
    import sys

    from service.app import create_app
    from service.server import server_of
    from service.service_settings import ServiceSettings
    from tests.service import fake_fold

    fake_fold.order(**json.loads(sys.argv[1]))
    environment = ServiceSettings.from_environment(os.environ)
    settings = environment.model_copy(update={"workers": 2, "max_body_bytes": int(sys.argv[2])})
    app = create_app(settings, fake_fold)
    server_of(app, settings, port=0).run()
