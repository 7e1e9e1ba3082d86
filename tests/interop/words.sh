# Reads the word-order test registers with mbpoll and compares them with docs/plc-registers.md.
# Usage: bash words.sh HOST PORT s7|logix
set -euo pipefail
host=$1 port=$2 order=$3
case $order in
  s7) expected="47F1 2000 0102 0304" big=-B ;;
  logix) expected="2000 47F1 0304 0102" big= ;;
  *) echo "words.sh: word order s7 or logix" >&2; exit 2 ;;
esac
values() { sed -n 's/^\[[0-9]*\]:[[:space:]]*\(0x\)\?//p' | tr '\n' ' ' | sed 's/ $//'; }
read_with() { mbpoll -m tcp -a 255 -0 -1 -p "$port" "$@" "$host"; }

# Holding registers, then input registers: the same words.
for table in 4 3; do
  got=$(read_with -t "$table:hex" -r 10 -c 4 | values)
  [[ $got == "$expected" ]] || { echo "words.sh: table $table reads $got, not $expected ($order)" >&2; exit 1; }
done
# And as mbpoll's own float: it wants -B for the high word first.
# shellcheck disable=SC2086
got=$(read_with $big -t 4:float -r 10 -c 1 | values)
[[ $got == 123456 ]] || { echo "words.sh: the f32 reads $got, not 123456 ($order)" >&2; exit 1; }
echo "mbpoll, $order: $expected, 123456"
