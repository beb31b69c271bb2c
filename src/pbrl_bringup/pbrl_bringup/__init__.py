"""Command line, demo, benches and the report's web page."""
