"""Reports of a study: page, tables and figures."""
