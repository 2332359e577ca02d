"""The pipeline: every stage as a doit task. The only room that knows all stages."""
