"""Data association: gating clusters, JPDA, JIPDA."""
