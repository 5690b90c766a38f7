"""What a user would write without urmpipe: pandas, numpy.unwrap, roboticstoolbox, send_columns."""

import sys

import numpy as np
import pandas as pd
import rerun as rr
from roboticstoolbox import ET, ETS

LENGTHS = [0.243215, *[0.21243] * 5, 0.042215]
TILT = np.radians(52.0)

log, target = sys.argv[1:]
table = pd.read_csv(log)
q = np.unwrap(table.iloc[:, 1:7].to_numpy(), axis=0)
t_ns = np.rint(table.iloc[:, 0].to_numpy() * 1e9).astype(np.int64)

arm = ETS(ET.Rz())
for k, length in enumerate(LENGTHS):
    arm = arm * ET.tz(length)
    if k < 6:
        arm = arm * ET.Ry(TILT)
    if k < 5:
        arm = arm * ET.Rz()
position = np.asarray(arm.fkine(q).A)[:, :3, 3]

with rr.RecordingStream("users_script") as recording:
    recording.save(target)
    time = [rr.TimeColumn("t", duration=t_ns.astype("timedelta64[ns]"))]
    recording.send_columns("joints", indexes=time, columns=rr.Scalars.columns(scalars=q))
    recording.send_columns("tcp", indexes=time, columns=rr.Scalars.columns(scalars=position))
