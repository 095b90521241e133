"""The way from every older schema to the newest one, version by version, walked by Alembic."""
