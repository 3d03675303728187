"""Data association: JPDA, JIPDA."""
