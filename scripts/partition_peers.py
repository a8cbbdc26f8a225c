"""Partitioners of others on the dual graph of a mesh: METIS and Scotch through ctypes, PT-Scotch and Zoltan by build/bin/partition_peers."""
import ctypes
import os
import pathlib
import subprocess
import time

import h5py
import numpy as np

TOLERANCE = 0.03
NODE_WORK = 100  # in elements: the paper's times, in which the bars are told


def load_library(*names):
    for name in names:
        try:
            return ctypes.CDLL(name, mode=ctypes.RTLD_GLOBAL)
        except OSError:
            continue
    return None


METIS = load_library("libmetis.so.5", "libmetis.so")
os.environ["SCOTCH_PTHREAD_NUMBER"] = "1"
SCOTCH = load_library("libscotch.so", "libscotch-7.0.so") if load_library("libscotcherr.so", "libscotcherr-7.0.so") else None


class Graph:
    """The dual graph of a tetrahedral mesh (the project's .h5 of one part), along its curve, with the elements' work, in integers."""

    def __init__(self, path):
        with h5py.File(path) as file:
            tets, points = file["p0000/cells"][:].astype(np.int64), file["p0000/points"][:]
            self.places = file["p0000/element_ids"][:]
        n = len(tets)
        faces = np.sort(tets[:, [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]]].reshape(-1, 3), axis=1)
        order = np.lexsort((faces[:, 2], faces[:, 1], faces[:, 0]))
        same = np.all(faces[order][1:] == faces[order][:-1], axis=1)
        first, second = order[:-1][same] // 4, order[1:][same] // 4
        ends = np.concatenate([np.stack([first, second], 1), np.stack([second, first], 1)])
        ends = ends[np.argsort(ends[:, 0], kind="stable")]
        self.nodes, self.elements = len(points), n
        self.start = np.concatenate([[0], np.cumsum(np.bincount(ends[:, 0], minlength=n))]).astype(np.int32)
        self.neighbours = np.ascontiguousarray(ends[:, 1], dtype=np.int32)
        valence = np.bincount(tets.ravel(), minlength=len(points))
        self.work = 1 + NODE_WORK * (1.0 / valence[tets]).sum(axis=1)
        self.centres = points[tets].mean(axis=1)
        self.low = points.min(axis=0)

    def write(self, path, values, form):
        """A value an element as meshtool reads them, by the elements' numbers."""
        ordered = np.empty_like(values)
        ordered[self.places] = values
        np.savetxt(path, ordered, fmt=form)

    def weights(self, factor=None):
        work = self.work if factor is None else self.work * factor
        return np.maximum(1, np.rint(2 * work)).astype(np.int32)

    def corner_factor(self, factor, share=0.05):
        """More work for the share of the elements nearest to the lower corner."""
        distance = np.linalg.norm(self.centres - self.low, axis=1)
        return np.where(distance <= np.quantile(distance, share), float(factor), 1.0)


def pointer(array):
    return array.ctypes.data_as(ctypes.POINTER(ctypes.c_int32))


def one(value, kind):
    return ctypes.byref(kind(value))


def run_metis(graph, weights, speeds, seed):
    """METIS's k-way method: the part of each element, and processor seconds."""
    n, parts = len(weights), len(speeds)
    options = np.empty(40, dtype=np.int32)
    METIS.METIS_SetDefaultOptions(pointer(options))
    options[8] = seed  # METIS_OPTION_SEED
    part = np.empty(n, dtype=np.int32)
    shares = (np.array(speeds) / sum(speeds)).astype(np.float32)
    start = time.process_time()
    METIS.METIS_PartGraphKway(one(n, ctypes.c_int32), one(1, ctypes.c_int32), pointer(graph.start), pointer(graph.neighbours),
                              pointer(weights), None, None, one(parts, ctypes.c_int32),
                              shares.ctypes.data_as(ctypes.c_void_p), one(1 + TOLERANCE, ctypes.c_float), pointer(options),
                              one(0, ctypes.c_int32), pointer(part))
    return part, time.process_time() - start


def run_scotch(graph, weights, speeds, seed):
    """Scotch's default strategy, which knows speeds but is told of no links."""
    n, parts = len(weights), len(speeds)
    for name in ("graph", "strat", "arch"):
        getattr(SCOTCH, f"SCOTCH_{name}Alloc").restype = ctypes.c_void_p
    whole, strategy, arch = (ctypes.c_void_p(getattr(SCOTCH, f"SCOTCH_{name}Alloc")()) for name in ("graph", "strat", "arch"))
    SCOTCH.SCOTCH_randomSeed(seed)
    SCOTCH.SCOTCH_randomReset()
    SCOTCH.SCOTCH_graphInit(whole)
    SCOTCH.SCOTCH_stratInit(strategy)
    SCOTCH.SCOTCH_archInit(arch)
    SCOTCH.SCOTCH_graphBuild(whole, 0, n, pointer(graph.start), None, pointer(weights), None, len(graph.neighbours),
                             pointer(graph.neighbours), None)
    SCOTCH.SCOTCH_stratGraphMapBuild(strategy, 0, parts, ctypes.c_double(TOLERANCE))
    load = np.rint(2 * np.array(speeds)).astype(np.int32)
    if len(set(speeds)) == 1:
        SCOTCH.SCOTCH_archCmplt(arch, parts)
    else:
        SCOTCH.SCOTCH_archCmpltw(arch, parts, pointer(load))
    part = np.empty(n, dtype=np.int32)
    start = time.process_time()
    SCOTCH.SCOTCH_graphMap(whole, arch, strategy, pointer(part))
    seconds = time.process_time() - start
    SCOTCH.SCOTCH_graphExit(whole)
    SCOTCH.SCOTCH_stratExit(strategy)
    SCOTCH.SCOTCH_archExit(arch)
    return part, seconds


class ParallelPeer:
    """PT-Scotch or Zoltan on some ranks; from a present partition where one is given."""

    def __init__(self, method, program, folder, ranks=2, start=None):
        self.method, self.program, self.folder, self.ranks, self.start = method, program, folder, ranks, start

    def __call__(self, graph, weights, speeds, seed):
        problem, out = self.folder / f"graph.{os.getpid()}", self.folder / f"parts.{os.getpid()}"
        start = np.full(len(weights), -1, dtype=np.int32) if self.start is None else self.start.astype(np.int32)
        with open(problem, "wb") as file:
            for array in (np.array([len(weights), len(graph.neighbours), len(speeds)], dtype=np.int64), graph.start,
                          graph.neighbours, weights, np.array(speeds, dtype=np.float64), graph.centres, start):
                file.write(np.ascontiguousarray(array).tobytes())
        done = subprocess.run(["mpiexec", "-n", str(self.ranks), self.program, problem, self.method, str(seed), out], check=True,
                              capture_output=True, text=True, env=environment())
        part = np.loadtxt(out, dtype=np.int32)
        for path in (problem, out):
            pathlib.Path(path).unlink()
        return part, float(done.stdout.split()[-1])


def environment():
    return {**os.environ, "OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1", "OMP_NUM_THREADS": "1",
            "OMPI_MCA_rmaps_base_oversubscribe": "1", "OMPI_MCA_mpi_yield_when_idle": "1",
            "OMPI_MCA_hwloc_base_binding_policy": "none"}


def serial_peers():
    return {name: run for name, library, run in (("METIS", METIS, run_metis), ("Scotch", SCOTCH, run_scotch)) if library}


def relabel(part, old, weights, parts):
    """Greedy new names that keep most of the work in place."""
    overlap = np.zeros((parts, parts))
    np.add.at(overlap, (part, old), weights)
    names = np.full(parts, -1)
    is_taken = np.zeros(parts, dtype=bool)
    for flat in np.argsort(-overlap, axis=None, kind="stable"):
        p, o = divmod(int(flat), parts)
        if names[p] < 0 and not is_taken[o]:
            names[p], is_taken[o] = o, True
    return names[part]
