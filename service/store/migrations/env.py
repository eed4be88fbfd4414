"""Run by alembic, over the connection that `service.store.database` hands it."""

from alembic import context

from service.store.tables import METADATA

# in one transaction with the caller's lock: tables are made once, or not at all
context.configure(
    connection=context.config.attributes["connection"],
    target_metadata=METADATA,
    transactional_ddl=True,
)
context.run_migrations()
