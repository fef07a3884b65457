#!/usr/bin/env bash
# gpsd from Debian reads our NMEA by UDP and shows a TPV: tests/gpsd.sh [DAYMARK]
# Installs nothing; says what is missing. Needs the fixtures' pictures only.
set -euo pipefail
cd "$(dirname "$0")/.."
daymark=$(realpath "${1:-target/release/daymark}")
PATH=$PATH:/sbin:/usr/sbin
missing=()
for tool in gpsd gpspipe; do command -v "$tool" >/dev/null || missing+=("$tool"); done
[ -x "$daymark" ] || missing+=("$daymark (cargo build --release)")
if [ ${#missing[@]} -gt 0 ]; then
    echo "missing: ${missing[*]} (Debian: gpsd gpsd-clients)"
    exit 2
fi

here=$(mktemp -d)
started=()
trap '[ ${#started[@]} -eq 0 ] || kill "${started[@]}" 2>/dev/null || true; rm -rf "$here"' EXIT
"$daymark" enroll --table "$here/table" --name Gate --no-lint --at 52.5,13.25 --position-error 20 fixtures/files/tower-1-left.pgm >/dev/null
mkdir "$here/frames"
for number in $(seq 100 400); do ln -s "$PWD/fixtures/files/tower-1-left.pgm" "$here/frames/$number.pgm"; done

port=${PORT:-20110} control=${CONTROL:-20947}
gpsd -N -n -S "$control" "udp://127.0.0.1:$port" >"$here/gpsd.log" 2>&1 &
started+=($!)
sleep 1
"$daymark" watch --table "$here/table" --frames "$here/frames" --real-time --rate 10 \
    --output "nmea:udp://127.0.0.1:$port" --output "nmea:$here/nmea.txt" 2>"$here/daymark.log" &
started+=($!)
gpspipe -w -x 20 "127.0.0.1:$control" >"$here/reports" || true
echo "== what daymark said"; head -n 4 "$here/nmea.txt"
echo "== what gpsd made of it"; grep -m 1 '"class":"TPV".*"lat"' "$here/reports" || { echo "no TPV with a position"; cat "$here/reports" "$here/gpsd.log"; exit 1; }

python3 - "$here/reports" <<'PYTHON'
import json, sys
reports = [json.loads(line) for line in open(sys.argv[1])]
fixes = [report for report in reports if report.get("class") == "TPV" and "lat" in report]
last = fixes[-1]
assert abs(last["lat"] - 52.5) < 1e-6 and abs(last["lon"] - 13.25) < 1e-6, last
# 5: dead reckoning, in gpsd's numbering of status; satellite fixes have 1 to 4.
assert all(fix.get("status", 0) == 5 for fix in fixes), fixes[0]
print(f"ok: {len(fixes)} positions, all marked as dead reckoning, none as a satellite fix")
PYTHON
