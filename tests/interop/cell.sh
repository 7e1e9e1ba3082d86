# Sourced: a cell of the real daemon with emulated pivot, scanner and robot, in a folder of its own, gone at the end.
#   write_cell PORT s7|logix [MORE LINES OF [plc]]   the cell file $work/cell.toml, an empty PORT: a free one
#   start_cell s7|logix [MORE LINES OF [plc]]        the same and the daemon on it; sets $plc to the daemon's Modbus port
#   stop_cell
# plc_role=client before it: the daemon polls a PLC at $plc, which somebody else has to play.
build=${BINPICK_BUILD:-$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)/../../build/release}
parts=$build/tests/support/parts
work=$(mktemp -d)
pids=()
stop_cell() {
  ((${#pids[@]} == 0)) || kill "${pids[@]}" 2>/dev/null || true
  wait 2>/dev/null || true
  pids=()
}
trap 'status=$?; stop_cell; ((status == 0)) || tail -n 40 "$work"/*.log; rm -rf "$work"' EXIT

free_ports() {
  /usr/bin/python3 - <<'PY'
import socket
kinds = [socket.SOCK_STREAM] * 3 + [socket.SOCK_DGRAM]
held = [socket.socket(socket.AF_INET, kind) for kind in kinds]
for s in held:
    s.bind(("127.0.0.1", 0))
print(*(s.getsockname()[1] for s in held))
PY
}

# Commands could come this way; the emulator ends when nobody holds it open any more.
mkfifo "$work/commands"
exec 8<>"$work/commands"

write_cell() {
  local any scanner robot can
  read -r any scanner robot can < <(free_ports)
  cat >"$work/cell.toml" <<TOML
[cell]
state_dir = "$work/state"
[plc]
$(if [[ ${plc_role-server} == client ]]; then echo 'role = "client"'; echo -n address; else echo -n listen; fi) = "127.0.0.1:${1:-$any}"
word_order = "$2"
${3-}
[pivot]
can = "cannelloni://127.0.0.1:$can"
T_base_pivot = { xyz_mm = [1200, 0, 1860], rpy_deg = [0, 90, 0] }
[scanner]
model = "lms400"
address = "127.0.0.1:$scanner"
start_deg = 70
range_deg = 40
T_pivot_scanner = { xyz_mm = [60, 0, 0], rpy_deg = [180, -90, 0] }
[robot]
dialect = "ur"
listen = "127.0.0.1:$robot"
[[supply]]
id = 1
size_mm = [1000, 800, 500]
T_base_supply = { xyz_mm = [1200, 0, 0], rpy_deg = [0, 0, 0] }
sweep_start_deg = -15
sweep_end_deg = 15
sweep_speed_deg_s = 30
[[part]]
id = 1
file = "$parts/track_link.toml"
knowledge_base = "$parts/track_link.kb"
TOML
}

start_cell() {
  local order=$1
  write_cell "" "$@"
  plc=$(sed -n 's/^\(listen\|address\) = "127.0.0.1:\(.*\)"/\2/p' "$work/cell.toml" | head -n 1)
  "$build/tools/binpick" check "$work/cell.toml"
  "$build/tests/emulators/program/binpick-emulator" pivot scanner robot --config "$work/cell.toml" \
    --part track_link --objects 6 --seed 4 <"$work/commands" >"$work/emulator-$order.log" 2>&1 &
  pids+=($!)
  "$build/daemon/binpickd" --config "$work/cell.toml" 2>"$work/binpickd-$order.log" &
  pids+=($!)
  [[ ${plc_role-server} == server ]] || return 0
  for _ in {1..100}; do
    (: <"/dev/tcp/127.0.0.1/$plc") 2>/dev/null && break
    sleep 0.1
  done
}
