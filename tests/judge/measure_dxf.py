"""What ezdxf finds in a DXF: for each layer the number of entities, their length and the box around them, as JSON."""

import json
import sys

import ezdxf
from ezdxf import path
from ezdxf.bbox import extents

document = ezdxf.readfile(sys.argv[1])
auditor = document.audit()
layers = {}
for entity in document.modelspace():
    layers.setdefault(entity.dxf.layer, []).append(entity)


def length(entity):
    points = list(path.make_path(entity).flattening(1e-4))
    return sum((b - a).magnitude for a, b in zip(points, points[1:]))


found = {
    "version": document.dxfversion,
    "units": document.units,
    "errors": [str(error.message) for error in auditor.errors],
    "colours": {name: document.layers.get(name).color for name in layers},
    "layers": {},
}
for name, entities in layers.items():
    box = extents(entities)
    found["layers"][name] = {
        "count": len(entities),
        "types": sorted({entity.dxftype() for entity in entities}),
        "length_mm": sum(length(entity) for entity in entities),
        "box_mm": [box.extmin.x, box.extmin.y, box.extmax.x, box.extmax.y],
    }
print(json.dumps(found))
