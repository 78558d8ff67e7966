"""Pages of ``dogshape app``: questions of a new study, live page of a study, and their server."""
