"""Files of the Rerun viewer, read back."""

from collections import defaultdict


def tables(stream):
    """The rows of each entity: its components, and `time` [s] and `scan` where they are not static."""
    found = defaultdict(list)
    for chunk in stream.to_chunks():
        batch = chunk.to_record_batch()
        names = [name.split(":")[-1] for name in batch.schema.names]
        for row in range(batch.num_rows):
            cells = {name: batch.column(i)[row].as_py() for i, name in enumerate(names)}
            if chunk.is_static:
                cells["static"] = True
            elif "time" in cells and cells["time"] is not None:
                cells["time"] = cells["time"].total_seconds()
            found[str(chunk.entity_path)].append(cells)
    return found
