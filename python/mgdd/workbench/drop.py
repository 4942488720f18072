"""The place where files are dropped: they are sent at once, in pieces, and are not kept by the page."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

from mgdd.io.extras import import_extra

# The dropper of Panel sends a file after its animations, a second later.
_SENDS = """
const PIECE = 8e6  // bytes of a message
const send = async (model, said, files) => {
  said.textContent = ""
  for (const file of files) {
    if (file.size > model.most_mb * 2 ** 20) {
      said.textContent += `${file.name}: ${Math.ceil(file.size / 1e6)} MB; a file may have ${model.most_mb} MB here:`
        + " use mgdd engine analyze FILE --chunk-cycles 100, or cut it. "
      continue
    }
    for (let at = 0, end = -1; end < file.size; at = end) {
      end = Math.min(at + PIECE, file.size)
      const data = await file.slice(at, end).arrayBuffer()
      model.send_msg({name: file.name, data, first: at == 0, last: end == file.size})
    }
  }
}
export function render({model}) {
  const [place, input, said] = ["label", "input", "span"].map((name) => document.createElement(name))
  place.textContent = `Drop ${model.several ? "files" : "a file"} here, or click to choose`
  Object.assign(input, {type: "file", multiple: model.several})
  input.onchange = () => send(model, said, [...input.files]).then(() => { input.value = "" })
  place.ondragover = (event) => { event.preventDefault(); place.className = "over" }
  place.ondragleave = () => { place.className = "" }
  place.ondrop = (event) => {
    event.preventDefault()
    place.className = ""
    send(model, said, [...event.dataTransfer.files])
  }
  place.append(input, said)
  return place
}
"""
_STYLE = """
label { display: block; padding: 18px; border: 2px dashed var(--panel-border-color); border-radius: 6px;
  text-align: center; cursor: pointer; font: 14px/1.5 system-ui, sans-serif; background: var(--panel-surface-color);
  color: var(--panel-on-background-color); }
label.over, label:focus-within { border-color: var(--panel-primary-color); }
input { position: absolute; opacity: 0; width: 1px; height: 1px; }
span { display: block; color: #d32f2f; font-weight: 600; }
"""


@cache
def _place() -> Any:
    """Make the class of the place, once Panel is there."""
    param = import_extra("param", "workbench", "the workbench")

    class FilePlace(import_extra("panel.custom", "workbench", "the workbench").JSComponent):  # type: ignore[misc]
        several = param.Boolean(default=False)
        most_mb = param.Integer(default=1)
        _esm, _stylesheets = _SENDS, [_STYLE]

    return FilePlace


def dropper(dropped: Callable[[str, bytes], object], most_mb: int, *, several: bool = False) -> Any:
    """Make the place where files are dropped; each of them goes to `dropped`."""
    pieces: dict[str, list[bytes]] = {}

    def arrived(message: Any) -> None:
        name, data, first, last = (message.data[key] for key in ("name", "data", "first", "last"))
        if first:
            pieces[name] = []
        if name not in pieces or sum(map(len, pieces[name])) + len(data) > most_mb << 20:
            pieces.pop(name, None)  # the page refuses what is too large; another client is not listened to
            return
        pieces[name].append(bytes(data))
        if last:
            dropped(name, b"".join(pieces.pop(name)))

    made = _place()(several=several, most_mb=most_mb, sizing_mode="stretch_width", margin=(4, 8))
    made.on_msg(arrived)
    return made
