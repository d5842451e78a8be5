// Other aircraft on the map: where they are, their heading, and how much higher than the drone.

import type { Sight } from "./sight";
import { bearingOf } from "./words";
import type { RobotStatus, Traffic } from "./wire";

/** Seconds without a word after which an aircraft is shown as old; after 10 it is gone. */
const OLD = 3;
/** m/s below which it has no heading. */
const SLOW = 0.5;

/** The aircraft that the drones of a flight hear of, each once: as the chosen drone hears it. */
export function trafficOf(statuses: RobotStatus[], chosen: RobotStatus | undefined): Traffic[] {
  const found = new Map<number, Traffic>();
  for (const status of [chosen, ...statuses]) {
    for (const one of status?.vehicle?.traffic ?? []) {
      if (!found.has(one.address)) found.set(one.address, one);
    }
  }
  return [...found.values()];
}

/** How much higher than the drone it is, which is `own` metres up. */
export function relativeHeight({ position: { z: up } }: Traffic, own: number | null): string {
  if (up === null) return "height unknown";
  if (own === null) return `${up.toFixed(0)} m up`;
  const above = Math.round(up - own);
  return above === 0 ? "same height" : `${Math.abs(above)} m ${above > 0 ? "above" : "below"}`;
}

/** Where it flies to. */
export function headingOf({ velocity }: Traffic): string {
  const [east, north] = [velocity.x ?? 0, velocity.y ?? 0];
  return Math.hypot(east, north) < SLOW ? "heading unknown" : bearingOf(east, north);
}

export function TrafficLayer(
  props: { traffic: Traffic[]; own: number | null; stale: boolean; sight: Sight },
) {
  return (
    <g>
      {props.traffic.map((one) => {
        const { x: east, y: north } = one.position;
        if (east === null || north === null) return null;
        const [ve, vn] = [one.velocity.x ?? 0, one.velocity.y ?? 0];
        const turn = (Math.atan2(ve, vn) * 180) / Math.PI;
        const moves = Math.hypot(ve, vn) >= SLOW;
        const age = one.age ?? 0;
        const old = props.stale || age > OLD;
        return (
          <g
            key={one.address}
            class={`traffic ${old ? "stale" : ""}`}
            transform={`translate(${props.sight.x(east)} ${props.sight.y(north)})`}
            data-aircraft={one.callsign}
          >
            {moves ? (
              <path
                d="M0-13V12M-12 2L0-4L12 2M-5 11L0 8L5 11"
                transform={`rotate(${turn.toFixed(0)})`}
              />
            ) : (
              <path d="M0-9L9 0L0 9L-9 0Z" />
            )}
            <text y="-34">
              {one.callsign}{" "}
              <tspan class="small" x="0" dy="15">
                {relativeHeight(one, props.own)}
                {moves && `, ${headingOf(one)}`}
                {age > OLD && `, ${age.toFixed(0)} s old`}
              </tspan>
            </text>
          </g>
        );
      })}
    </g>
  );
}
