// The artificial horizon: roll and pitch as a pilot sees them, with the heading.

import { bearingOf } from "./words";
import type { RobotStatus } from "./wire";

/** Pixels of a degree of pitch; a drone pitches more than 30° in no ordinary flight. */
const DEGREE = 0.9;
const LADDER = [-20, -10, 10, 20];

/** Nothing without an attitude. */
export function Attitude({ vehicle }: Pick<RobotStatus, "vehicle">) {
  const { roll: side, pitch, yaw } = vehicle?.odometry ?? {};
  if (side == null || pitch == null || yaw == null) return null;
  // Pitch is positive with the nose down, roll with the right side down, yaw counter-clockwise from east.
  const [roll, down] = [degrees(side), degrees(pitch)];
  const words = (value: number, positive: string, negative: string) =>
    `${Math.abs(value).toFixed(0)}° ${value < 0 ? negative : positive}`;
  return (
    <div class="attitude" data-testid="attitude">
      <svg width="72" height="72" viewBox="-36 -36 72 72" aria-hidden="true">
        <clipPath id="horizon">
          <circle r="34" />
        </clipPath>
        <g clip-path="url(#horizon)">
          <g transform={`rotate(${(-roll).toFixed(1)}) translate(0 ${(-DEGREE * down).toFixed(1)})`}>
            <rect class="sky" x="-80" y="-160" width="160" height="160" />
            <rect class="ground" x="-80" y="0" width="160" height="160" />
            {LADDER.map((angle) => (
              <path key={angle} class="ladder" d={`M-8 ${DEGREE * angle}H8`} />
            ))}
          </g>
        </g>
        <path class="vehicle" d="M-24 0H-10L-5 5M24 0H10L5 5M0 -1V1" />
        <circle class="rim" r="34" />
      </svg>
      <dl>
        <dt>Heading</dt>
        <dd>{bearingOf(Math.cos(yaw), Math.sin(yaw))}</dd>
        <dt>Roll</dt>
        <dd>{words(roll, "right", "left")}</dd>
        <dt>Pitch</dt>
        <dd>{words(down, "down", "up")}</dd>
      </dl>
    </div>
  );
}

function degrees(radians: number): number {
  return (radians * 180) / Math.PI;
}
