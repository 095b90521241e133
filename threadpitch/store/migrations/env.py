"""What Alembic runs: the steps in one transaction of the connection that was handed over."""

from __future__ import annotations

from alembic import context

context.configure(
    connection=context.config.attributes["connection"],
    # SQLite changes its schema within transactions too, which Alembic does not suppose: all steps or none.
    transactional_ddl=True,
    transaction_per_migration=False,
)
with context.begin_transaction():
    context.run_migrations()
