"""One file for each version of the schema. A version that was published is never changed."""
