#!/usr/bin/env bash
# Runs a command and is never silent for long: after 15 s without output (or ALOUD_SECONDS) it says that the
# command is still at work. The exit status is that of the command. Usage: tools/aloud.sh COMMAND ARGUMENT...
set -uo pipefail
name="$(basename "$1")"
"$@" 2>&1 | {
  begun="" # a line has begun and waits for its end, as the dots of a test run do
  while true; do
    text=""
    if IFS= read -r -t "${ALOUD_SECONDS:-15}" text; then
      printf '%s\n' "$text"
      begun=""
    elif (($? > 128)); then
      if [[ -n "$text" ]]; then
        printf '%s' "$text"
        begun=yes
      else
        printf '%s... %s, %d s so far\n' "${begun:+$'\n'}" "$name" "$SECONDS"
        begun=""
      fi
    else
      printf '%s' "$text"
      break
    fi
  done
}
exit "${PIPESTATUS[0]}"
