"""HTML, read as text."""

from html.parser import HTMLParser


class Page(HTMLParser):
    """Elements with their attributes and text, and that all are closed in order."""

    VOID = ("meta", "link", "img", "br")

    def __init__(self, text):
        super().__init__()
        self.elements, self._open, self.texts = [], [], {}
        self.feed(text)
        assert self._open == []

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))
        if tag not in self.VOID:
            self._open.append((tag, len(self.elements) - 1))

    def handle_endtag(self, tag):
        assert self._open.pop()[0] == tag

    def handle_data(self, data):
        for _, i in self._open:
            self.texts[i] = self.texts.get(i, "") + data

    def of(self, tag, **attributes):
        return [
            (given, self.texts.get(i, ""))
            for i, (name, given) in enumerate(self.elements)
            if name == tag and attributes.items() <= {k.rstrip("_"): v for k, v in given.items()}.items()
        ]

    def commands(self):
        return [text for given, text in self.of("code") if given.get("class") == "command"]
