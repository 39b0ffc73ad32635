"""CoreXY as printers have it: toothed belts that stretch, in a frame, with their drives."""

from ._belts import Belts as Belts
from ._belts import Frame as Frame
from ._belts import Spans as Spans
from ._machine import ElasticCoreXY as ElasticCoreXY
