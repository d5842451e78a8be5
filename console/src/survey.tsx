// An area to survey: drawn on the map or typed, planned by the server, flown by one command.

import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import { type Flight, aheadOf } from "./flight";
import { Field } from "./panels";
import type { Abilities, Point } from "./place";
import type { Drawn } from "./survey_map";
import type { SurveyIn, SurveyOut, SurveyPhotosOut, Waypoint } from "./wire";

/** Milliseconds without a change before a plan is asked for. */
const PAUSE = 250;
const CORNERS = 30;
const NOWHERE: Point[] = [];
/** Centimetres of ground in a pixel that are suggested. */
const RESOLUTION = 2;

interface Settings {
  /** Id of the camera that takes pictures; null for none. */
  camera: string | null;
  height: number;
  /** Centimetres of ground in a pixel, by which the height is chosen; null to give the height. */
  resolution: number | null;
  /** Percent of a picture that the next one on its line, and the one beside it, show, too. */
  frontOverlap: number;
  sideOverlap: number;
  fieldOfView: number;
  overlap: number;
  /** Metres; null for what the camera sees. */
  width: number | null;
  /** Degrees clockwise from north; null for the shortest path. */
  direction: number | null;
  speed: number | null;
  around: boolean;
}

/** The survey being drawn; null while none is. */
export interface Survey extends Drawn {
  flight: Flight;
  robot: string;
  /** Of the robot. */
  cameras: string[];
  settings: Settings;
  plan: SurveyOut | null;
  problem: string;
  set(settings: Partial<Settings>): void;
  fly(): void;
}

export function useSurvey(
  flight: Flight | null,
  robot: string,
  height: number,
  abilities: Abilities | undefined,
): { survey: Survey | null; begin(): void } {
  const [area, setArea] = useState<Point[] | null>(null);
  const [settings, setSettings] = useState<Settings | null>(null);
  const [answer, setAnswer] = useState<{ asked: string; plan: SurveyOut } | null>(null);
  const [refusal, setRefusal] = useState<{ asked: string; text: string } | null>(null);
  const name = useRef("");
  const wanted = area && settings ? request(robot, area, settings, name.current) : null;
  const asked = wanted ? JSON.stringify(wanted) : "";

  useEffect(() => {
    if (!flight || !asked) return;
    let gone = false;
    const timer = setTimeout(() => {
      flight
        .survey(JSON.parse(asked) as SurveyIn)
        .then((plan) => gone || setAnswer({ asked, plan }))
        .catch((error: unknown) => {
          const text = error instanceof Error ? error.message : String(error);
          if (!gone) setRefusal({ asked, text });
        });
    }, PAUSE);
    return () => {
      gone = true;
      clearTimeout(timer);
    };
  }, [flight, asked]);
  // Another drone is another survey.
  useEffect(() => setArea(null), [robot]);

  const plan = answer !== null && answer.asked === asked ? answer.plan : null;
  const problem = refusal !== null && refusal.asked === asked ? refusal.text : "";
  const path = useMemo<Point[]>(() => plan?.waypoints.map((one) => [one.x, one.y]) ?? [], [plan]);
  const photos = plan?.photos?.places ?? NOWHERE;
  const begin = () => {
    // Of one column, map and form stand at the top.
    document.querySelector(".map")?.scrollIntoView({ block: "nearest" });
    name.current = `s${Date.now().toString(36).slice(-4)}`;
    setArea([]);
    setSettings({
      camera: abilities?.surveys ?? null,
      height: Number(height.toFixed(1)),
      resolution: null,
      frontOverlap: 75,
      sideOverlap: 65,
      fieldOfView: abilities?.fieldOfView ?? 82.6,
      overlap: 20,
      width: null,
      direction: null,
      speed: null,
      around: false,
    });
  };
  if (!flight || !area || !settings) return { survey: null, begin };
  const survey: Survey = {
    flight,
    robot,
    cameras: abilities?.cameras ?? [],
    area,
    path,
    photos,
    settings,
    plan,
    problem,
    refused: problem !== "",
    add: (point) => area.length < CORNERS && setArea([...area, round(point)]),
    move: (corner, to) => setArea(area.map((one, place) => (place === corner ? round(to) : one))),
    undo: () => setArea(area.slice(0, -1)),
    cancel: () => setArea(null),
    set: (some) => setSettings({ ...settings, ...some }),
    fly: () => {
      const waypoints = plan?.waypoints ?? [];
      const [first, ...rest] = waypoints;
      if (!first) return;
      const last = waypoints[waypoints.length - 1]?.id ?? first.id;
      const list: [Waypoint, ...Waypoint[]] = [first, ...rest];
      flight.fly({ robot, waypoints: list }, `survey ${name.current}`, (status) => {
        const known = [...aheadOf(status), ...status.visited];
        return known.includes(last) ? `its ${waypoints.length} waypoints are in the plan` : null;
      });
      setArea(null);
    },
  };
  return { survey, begin };
}

function request(robot: string, area: Point[], how: Settings, name: string): SurveyIn | null {
  const corners = area.map(([east, north]): [number, number] => [east, north]);
  const [a, b, c, ...more] = corners;
  const planned = how.camera !== null && how.resolution !== null ? how.resolution : how.height;
  if (!a || !b || !c || !(planned > 0)) return null;
  const radians = Math.PI / 180;
  return {
    robot,
    area: [a, b, c, ...more],
    ...(how.camera !== null && how.resolution !== null
      ? { ground_resolution: how.resolution / 100 }
      : { height: how.height }),
    ...strips(how),
    angle: how.direction === null ? null : (90 - how.direction) * radians,
    speed: how.speed,
    around: how.around,
    name,
  };
}

/** What decides how far the lines lie apart. */
function strips(how: Settings): Partial<SurveyIn> {
  if (how.camera !== null) {
    return {
      camera: how.camera,
      overlap: how.sideOverlap / 100,
      front_overlap: how.frontOverlap / 100,
    };
  }
  const overlap = how.overlap / 100;
  return how.width === null
    ? { field_of_view: (how.fieldOfView * Math.PI) / 180, overlap }
    : { width: how.width, overlap };
}

function round([east, north]: Point): Point {
  return [Number(east.toFixed(2)), Number(north.toFixed(2))];
}

export function SurveyPanel(props: { survey: Survey; ceiling: number; zones: boolean }) {
  const { survey, ceiling, zones } = props;
  const { settings, plan, area } = survey;
  const given = (value: string) => (value === "" ? null : Number(value));
  return (
    <form
      class="card surveyform"
      aria-label="Survey"
      onSubmit={(event) => {
        event.preventDefault();
        survey.fly();
      }}
    >
      <h2>Survey an area with {survey.robot}</h2>
      <p class="hint">
        {area.length < 3
          ? "Click the corners on the map, or press Enter at its cross. Backspace takes one back."
          : "Drag corners to change them, click for more."}
      </p>
      {survey.cameras.length > 0 && (
        <label>
          <span>Pictures</span>
          <select
            name="camera"
            value={settings.camera ?? ""}
            onChange={(event) => survey.set({ camera: event.currentTarget.value || null })}
          >
            <option value="">none</option>
            {survey.cameras.map((name) => (
              <option key={name} value={name}>
                by {name}
              </option>
            ))}
          </select>
        </label>
      )}
      {settings.camera !== null && (
        <label>
          <span>Planned by</span>
          <select
            name="by"
            value={settings.resolution === null ? "height" : "resolution"}
            onChange={(event) =>
              survey.set({
                resolution: event.currentTarget.value === "height" ? null : RESOLUTION,
              })
            }
          >
            <option value="height">height</option>
            <option value="resolution">resolution</option>
          </select>
        </label>
      )}
      {settings.camera !== null && settings.resolution !== null ? (
        <Field
          key="resolution"
          name="resolution"
          label="Resolution, cm/pixel"
          value={String(settings.resolution)}
          min={0.05}
          max={1000}
          step="any"
          onValue={(value) => survey.set({ resolution: Number(value) })}
        />
      ) : (
        <Field
          key="height"
          name="height"
          label="Height, m"
          value={String(settings.height)}
          min={0.5}
          max={ceiling}
          onValue={(value) => survey.set({ height: Number(value) })}
        />
      )}
      {settings.camera === null ? <Strips survey={survey} /> : <Overlaps survey={survey} />}
      <Field
        name="direction"
        label="Direction, ° of north"
        value=""
        min={0}
        max={360}
        step="1"
        optional="shortest"
        onValue={(value) => survey.set({ direction: given(value) })}
      />
      <Field
        name="speed"
        label="Speed, m/s"
        value=""
        min={0.1}
        optional="cruise"
        onValue={(value) => survey.set({ speed: given(value) })}
      />
      {zones && (
        <label class="check">
          <input
            type="checkbox"
            name="around"
            checked={settings.around}
            onChange={(event) => survey.set({ around: event.currentTarget.checked })}
          />
          <span>Fly around no-fly zones</span>
        </label>
      )}
      <Corners survey={survey} />
      <Figures survey={survey} />
      <div class="buttons">
        <button type="submit" class="primary" disabled={plan === null}>
          Fly the survey
        </button>
        <button type="button" disabled={area.length === 0} onClick={survey.undo}>
          Undo corner
        </button>
        <button type="button" onClick={survey.cancel}>
          Cancel
        </button>
      </div>
    </form>
  );
}

/** Strips without pictures: of a given width, or as a camera sees. */
function Strips({ survey }: { survey: Survey }) {
  const { settings } = survey;
  return (
    <>
      <Field
        key="fov"
        name="fov"
        label="Camera's view, °"
        value={String(settings.fieldOfView)}
        min={2}
        max={170}
        onValue={(value) => survey.set({ fieldOfView: Number(value) })}
      />
      <Field
        key="overlap"
        name="overlap"
        label="Overlap, %"
        value={String(settings.overlap)}
        min={0}
        max={90}
        step="1"
        onValue={(value) => survey.set({ overlap: Number(value) })}
      />
      <Field
        key="width"
        name="width"
        label="Strips, m"
        value={settings.width === null ? "" : String(settings.width)}
        min={0.1}
        optional="as the camera sees"
        onValue={(value) => survey.set({ width: value === "" ? null : Number(value) })}
      />
    </>
  );
}

/** How much neighbouring pictures have in common. */
function Overlaps({ survey }: { survey: Survey }) {
  const { settings } = survey;
  return (
    <>
      <Field
        key="front"
        name="front"
        label="Overlap ahead, %"
        value={String(settings.frontOverlap)}
        min={0}
        max={95}
        step="1"
        onValue={(value) => survey.set({ frontOverlap: Number(value) })}
      />
      <Field
        key="side"
        name="side"
        label="Overlap aside, %"
        value={String(settings.sideOverlap)}
        min={0}
        max={90}
        step="1"
        onValue={(value) => survey.set({ sideOverlap: Number(value) })}
      />
    </>
  );
}

/** The corners as numbers, for whoever uses no pointer or knows them. */
function Corners({ survey }: { survey: Survey }) {
  if (survey.area.length === 0) return null;
  const set = (corner: number, axis: 0 | 1, value: number) => {
    const [east, north] = survey.area[corner] ?? [0, 0];
    survey.move(corner, axis === 0 ? [value, north] : [east, value]);
  };
  return (
    <details class="corners">
      <summary>{survey.area.length} corners</summary>
      <ol>
        {survey.area.map((point, corner) => (
          <li key={corner}>
            {([0, 1] as const).map((axis) => (
              <input
                key={axis}
                type="number"
                step="0.1"
                aria-label={`Corner ${corner + 1}, metres ${axis === 0 ? "east" : "north"}`}
                value={point[axis]}
                onChange={(event) => set(corner, axis, Number(event.currentTarget.value))}
              />
            ))}
          </li>
        ))}
      </ol>
    </details>
  );
}

function Figures({ survey }: { survey: Survey }) {
  const { plan, problem, area } = survey;
  if (problem) {
    return (
      <p class="problem" role="alert" data-testid="survey-problem">
        {problem}
      </p>
    );
  }
  if (!plan) {
    return (
      <p class="hint" role="status">
        {area.length < 3 ? "An area has three corners or more." : "Planning…"}
      </p>
    );
  }
  const short = plan.available !== null && plan.battery > plan.available;
  const percent = (charge: number) => `${(100 * charge).toFixed(0)} %`;
  return (
    <>
      <dl class="figures" data-testid="survey-plan" aria-live="polite">
        <div class="figure">
          <dt>Path</dt>
          <dd>
            {plan.length.toFixed(0)} <small>m</small>
          </dd>
        </div>
        <div class="figure">
          <dt>Time</dt>
          <dd>{minutes(plan.seconds)}</dd>
        </div>
        <div class="figure">
          <dt>Sweeps</dt>
          <dd>
            {plan.sweeps} <small>of {plan.width.toFixed(1)} m</small>
          </dd>
        </div>
        <div class="figure">
          <dt>Battery, and home</dt>
          <dd class={short ? "bad" : ""}>{percent(plan.battery)}</dd>
        </div>
        {plan.photos && <Photos photos={plan.photos} height={plan.height} />}
      </dl>
      {plan.photos?.warning && (
        <p class="problem" role="alert" data-testid="survey-warning">
          {plan.photos.warning}.
        </p>
      )}
      {short && (
        <p class="problem" role="alert">
          Only {percent(plan.available ?? 0)} is there to spend: the drone will turn back before the
          end.
        </p>
      )}
    </>
  );
}

function Photos({ photos, height }: { photos: SurveyPhotosOut; height: number }) {
  return (
    <>
      <div class="figure">
        <dt>Pictures</dt>
        <dd>{photos.places.length}</dd>
      </div>
      <div class="figure">
        <dt>One every</dt>
        <dd>
          {photos.interval.toFixed(1)} <small>s, {photos.spacing.toFixed(1)} m</small>
        </dd>
      </div>
      <div class="figure">
        <dt>Resolution</dt>
        <dd>
          {photos.resolution === null ? "–" : (100 * photos.resolution).toPrecision(2)}{" "}
          <small>cm/pixel</small>
        </dd>
      </div>
      <div class="figure">
        <dt>Height</dt>
        <dd>
          {height.toFixed(1)} <small>m</small>
        </dd>
      </div>
    </>
  );
}

function minutes(seconds: number): string {
  const whole = Math.round(seconds);
  return `${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, "0")} min`;
}
