"""The same run of steps under DBOS with SQLite: `steps_dbos.py FOLDER STEPS`; it goes on if the folder has one."""

import os
import sys

from dbos import DBOS, SetWorkflowID

folder, steps = sys.argv[1], int(sys.argv[2])
lines = os.open(f"{folder}/lines", os.O_WRONLY | os.O_APPEND | os.O_CREAT)
DBOS(config={"name": "steps", "system_database_url": f"sqlite:///{folder}/dbos.sqlite", "application_version": "1"})


@DBOS.step()
def add_line(number):
    os.write(lines, f"{number}\n".encode())


@DBOS.workflow()
def run(steps):
    for number in range(steps):
        add_line(number)


DBOS.launch()
with SetWorkflowID("steps"):
    DBOS.start_workflow(run, steps).get_result()
os._exit(0)
