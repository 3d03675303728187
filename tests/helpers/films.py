"""Films, decoded."""

import av


def frames_of(path):
    with av.open(str(path)) as film:
        stream = film.streams.video[0]
        return stream.codec_context.name, sum(1 for _ in film.decode(stream))
