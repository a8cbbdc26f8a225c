"""Reads what a run wrote: summary, history, probes and fields.

    import results
    run = results.Run("out/press")
    run.summary["wall_s"], run.history["time_s"], run.snapshot(-1).nodes["velocity"]
"""
import csv
import dataclasses
import functools
import json
import pathlib
import xml.etree.ElementTree as ElementTree

import numpy as np


@dataclasses.dataclass
class Snapshot:
    """All partitions of one output together. Nodes on the interfaces of partitions stand in it once per partition."""
    time: float
    points: np.ndarray    # [node][dim], m
    elements: np.ndarray  # [element][dim + 1], numbers of nodes
    nodes: dict           # field name -> values at nodes
    cells: dict           # field name -> values in elements
    partition_sizes: list  # (nodes, elements) of each partition

    def volumes(self):
        """Volume of each element, m^3; in the plane its area."""
        corner = self.points[self.elements]
        dim = self.elements.shape[1] - 1
        return np.linalg.det(corner[:, 1:, :dim] - corner[:, :1, :dim]) / (2 if dim == 2 else 6)


def read_table(path):
    """Columns of a CSV file by name; an empty cell is NaN, and a column of words stays words."""
    with open(path, newline="") as file:
        rows = list(csv.reader(file))
    columns = {name: [row[k] for row in rows[1:]] for k, name in enumerate(rows[0])}
    return {name: numbers(cells) for name, cells in columns.items()}


def numbers(cells):
    try:
        return np.array([float(cell) if cell else np.nan for cell in cells])
    except ValueError:
        return np.array(cells)


class Run:
    """An output directory."""

    def __init__(self, directory):
        self.directory = pathlib.Path(directory)

    @functools.cached_property
    def summary(self):
        return json.loads((self.directory / "summary.json").read_text())

    @functools.cached_property
    def history(self):
        return read_table(self.directory / "history.csv")

    def probe(self, name):
        return read_table(self.directory / f"probe-{name}.csv")

    @functools.cached_property
    def _collections(self):
        path, = self.directory.glob("*.xdmf")
        return ElementTree.parse(path).getroot().findall(".//Grid[@CollectionType='Spatial']")

    @functools.cached_property
    def times(self):
        return [float(collection.find("Time").get("Value")) for collection in self._collections]

    def snapshot(self, index=-1):
        """The output of that number; -1 is the last."""
        collection, parts = self._collections[index], []
        for grid in collection.findall("Grid"):
            points = self._values(grid.find("Geometry"))
            elements = self._values(grid.find("Topology"))
            fields = {"Node": {}, "Cell": {}}
            for attribute in grid.findall("Attribute"):
                fields[attribute.get("Center")][attribute.get("Name")] = self._values(attribute)
            parts.append((points, elements, fields["Node"], fields["Cell"]))
        starts = np.cumsum([0] + [len(part[0]) for part in parts])
        return Snapshot(time=self.times[index],
                        points=np.concatenate([part[0] for part in parts]).astype(float),
                        elements=np.concatenate([part[1] + start for part, start in zip(parts, starts)]),
                        nodes={name: np.concatenate([part[2][name] for part in parts]) for name in parts[0][2]},
                        cells={name: np.concatenate([part[3][name] for part in parts]) for name in parts[0][3]},
                        partition_sizes=[(len(part[0]), len(part[1])) for part in parts])

    def _values(self, parent):
        import h5py
        name, _, dataset = parent.find("DataItem").text.strip().partition(":")
        with h5py.File(self.directory / name, "r") as file:
            return file[dataset][()]


def positive_share(values):
    """Share of each simplex in which the linear function with the given corner values [simplex][corner] is positive.

    Volume of {f > 0} over that of the simplex = sum over corners i with f_i > 0 of f_i^d / product over j of (f_i - f_j).
    """
    corners = values.shape[1]
    scale = np.abs(values).max(axis=1, keepdims=True) + np.finfo(float).tiny
    # Equal corners make the terms singular, their sum does not: a slope of 1e-5 takes ties apart.
    f = values / scale + 1e-5 * np.arange(corners)
    terms = [np.where(f[:, i] > 0, f[:, i] ** (corners - 1), 0)
             / np.prod([f[:, i] - f[:, j] for j in range(corners) if j != i], axis=0) for i in range(corners)]
    share = np.clip(sum(terms), 0, 1)
    share[(values > 0).all(axis=1)] = 1
    share[(values <= 0).all(axis=1)] = 0
    return share
