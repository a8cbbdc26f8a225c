"""Run by pvpython or pvbatch: prints, as JSON, what ParaView finds in an .xdmf file at each of its times.

usage: paraview_counts.py READER FILE [HOST PORT]      READER: XDMFReader or Xdmf3ReaderT; HOST PORT: of a pvserver
"""
import json
import sys

from paraview import simple
from paraview.modules.vtkRemotingCore import vtkProcessModule

reader_name, file = sys.argv[1:3]
if len(sys.argv) > 3:
    simple.Connect(sys.argv[3], int(sys.argv[4]))
if reader_name == "XDMFReader":
    reader = simple.XDMFReader(FileNames=[file])
else:
    reader = simple.Xdmf3ReaderT(FileName=[file])
reader.UpdatePipelineInformation()
found = []
for time in list(reader.TimestepValues):
    reader.UpdatePipeline(time)
    information = reader.GetDataInformation()
    found.append({"time": time, "points": information.GetNumberOfPoints(), "cells": information.GetNumberOfCells(),
                  "bounds": information.GetBounds(),
                  "nodes": {name: reader.PointData[name].GetRange(-1) for name in reader.PointData.keys()},
                  "elements": {name: reader.CellData[name].GetRange(-1) for name in reader.CellData.keys()}})
if vtkProcessModule.GetProcessModule().GetPartitionId() == 0:
    print("FOUND " + json.dumps(found), flush=True)
