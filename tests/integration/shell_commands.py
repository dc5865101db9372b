"""The program for shells: commands that are forked off a process in which all is loaded.

What a page or the README says is typed into a shell. Each command there would load the whole program anew,
for two seconds; here `impactcell` and `python -m` are scripts that pass the command on, with its files and
its directory, and end as it ends. That the installed scripts start is tried by the demo and by the service,
which are processes of their own.
"""

import array
import contextlib
import json
import os
import runpy
import signal
import socket
import sys
import threading
from collections.abc import Iterator
from multiprocessing.connection import Connection
from pathlib import Path

from tests.integration.forked import SERVER

CLIENT = """#!{python} -ISs
import array, json, os, signal, socket, sys
arguments = {prefix!r} + sys.argv[1:]
if arguments[:1] == ["-m"] and arguments[1] in ("impactcell", "simulator"):
    arguments = arguments[1:]
if arguments[0] not in ("impactcell", "simulator"):
    os.execv({python!r}, [{python!r}, *arguments])
server = socket.socket(socket.AF_UNIX)
server.connect({address!r})
for number in (signal.SIGTERM, signal.SIGINT):
    signal.signal(number, lambda number, _: server.send(bytes([number])))
command = json.dumps([arguments, os.getcwd(), dict(os.environ)]).encode()
files = array.array("i", (0, 1, 2))
head = len(command).to_bytes(4, "big")
server.sendmsg([head], [(socket.SOL_SOCKET, socket.SCM_RIGHTS, files)])
server.sendall(command)
sys.exit(int(server.makefile().readline()))
"""
"""A Python without its libraries, which is there in a hundredth of a second."""


def _run(arguments: list[str], directory: str, environment: dict[str, str], files: list[Connection]) -> None:
    signal.set_wakeup_fd(-1)
    for number, file in enumerate(files):
        os.dup2(file.fileno(), number)
        file.close()
    os.environ.clear()
    os.environ.update(environment)
    os.chdir(directory)
    sys.stdin = open(0, encoding="utf-8", closefd=False)  # noqa: SIM115 - as long as the process
    sys.argv = arguments
    runpy.run_module(arguments[0], run_name="__main__", alter_sys=True)


def _answer(client: socket.socket) -> None:
    with client, client.makefile("rb") as stream:
        head, rights, _, _ = client.recvmsg(4, socket.CMSG_SPACE(3 * array.array("i").itemsize))
        files = [Connection(number) for number in array.array("i", rights[0][2])]
        arguments, directory, environment = json.loads(stream.read(int.from_bytes(head, "big")))
        process = SERVER.Process(target=_run, args=(arguments, directory, environment, files))
        process.start()
        for file in files:
            file.close()

        def pass_signals_on() -> None:
            with contextlib.suppress(OSError, ValueError):
                while number := stream.read(1):
                    os.kill(process.pid, number[0])

        threading.Thread(target=pass_signals_on, daemon=True).start()
        process.join()
        code = process.exitcode or 0
        with contextlib.suppress(OSError):  # the client was killed
            client.sendall(b"%d\n" % (code if code >= 0 else 128 - code))
            client.shutdown(socket.SHUT_RDWR)


@contextlib.contextmanager
def shell_commands(directory: Path) -> Iterator[None]:
    """Put `impactcell` and `python` into a directory, as long as it lasts."""
    directory.mkdir(parents=True, exist_ok=True)
    with socket.socket(socket.AF_UNIX) as listener:
        address = f"\0{directory}"  # in no file system: its length has a limit there
        listener.bind(address)
        listener.listen()

        def serve() -> None:
            with contextlib.suppress(OSError):
                while True:
                    client, _ = listener.accept()
                    threading.Thread(target=_answer, args=(client,), daemon=True).start()

        threading.Thread(target=serve, daemon=True).start()
        for name, prefix in (("impactcell", ["impactcell"]), ("python", [])):
            script = directory / name
            script.write_text(CLIENT.format(python=sys.executable, prefix=prefix, address=address))
            script.chmod(0o755)
        yield
        listener.shutdown(socket.SHUT_RDWR)
