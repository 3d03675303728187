"""Films, decoded."""

import av


def frames_of(path):
    """Codec and number of pictures."""
    with av.open(str(path)) as film:
        stream = film.streams.video[0]
        return stream.codec_context.name, sum(1 for _ in film.decode(stream))


def decoded(path):
    """Pictures, and times [s]."""
    with av.open(str(path)) as film:
        frames = list(film.decode(video=0))
    return [frame.to_ndarray(format="rgb24") for frame in frames], [float(f.pts * f.time_base) for f in frames]
