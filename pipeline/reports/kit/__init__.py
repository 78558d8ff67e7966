"""Components that all pages share: templates, look, maps, HTML."""
