"""HTML, read as text."""

from html.parser import HTMLParser


class Page(HTMLParser):
    """Elements with their attributes and text, and that all are closed in order."""

    VOID = ("meta", "link", "img", "br", "input")

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
        """Attributes and text of a tag's elements with these attributes (`class_` for class)."""
        asked = {name.rstrip("_"): value for name, value in attributes.items()}.items()
        return [
            (given, self.texts.get(i, ""))
            for i, (name, given) in enumerate(self.elements)
            if name == tag and asked <= given.items()
        ]

    def asks_for_nothing(self):
        """Assert that nothing comes from elsewhere and no attribute is a script; the rules of its policy."""
        for tag, given in self.elements:
            for name in ("src", "href", "srcset", "action", "data", "poster"):
                assert given.get(name, "#").startswith(("#", "data:")), (tag, name)
            assert not any(name.startswith("on") for name in given)
        assert all("url(" not in style and "@import" not in style for _, style in self.of("style"))
        policy = next(g["content"] for g, _ in self.of("meta") if g.get("http-equiv") == "Content-Security-Policy")
        return dict(rule.strip().split(" ", 1) for rule in policy.split(";"))

    def commands(self):
        return [text for _, text in self.of("code", class_="command")]
