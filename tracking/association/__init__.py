"""Data association: gating batches, JPDA, JIPDA."""
