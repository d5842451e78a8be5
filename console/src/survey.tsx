// An area to survey: drawn on the map or typed, planned by the server, flown by one command.

import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import { ask, messageOf } from "./connection";
import { type Flight, aheadOf, idsOf } from "./flight";
import { type Point, camerasOf, surveyCamera } from "./place";
import type { Drawn } from "./survey_map";
import { Button, Field, type FieldProps, Figure, type FigureProps, Select } from "./widgets";
import { clock } from "./words";
import type { RobotConfig, SurveyIn, SurveyOut, Waypoint } from "./wire";

/** Milliseconds without a change before a plan is asked for. */
const PAUSE = 250;
const CORNERS = 30;
const NOWHERE: Point[] = [];
const RADIANS = Math.PI / 180;
/** Metres of ground in a pixel that are suggested. */
const RESOLUTION = 0.02;
/** Degrees that a camera sees whose field of view is not known. */
const FIELD_OF_VIEW = 82.6;
const CEILING = 120;

/** How an area is surveyed. */
type Settings = Omit<SurveyIn, "robot" | "area" | "name">;

/** Settings of a survey by a camera, and of one without pictures. */
const byCamera = (camera: string) => ({ camera, overlap: 0.65, front_overlap: 0.75 });
const byView = (degrees: number) => ({
  ...{ camera: null, ground_resolution: null, overlap: 0.2 },
  ...{ field_of_view: degrees * RADIANS, width: null },
});

/** The survey being drawn; null while none is. */
export interface Survey extends Drawn {
  robot: string;
  config: RobotConfig | undefined;
  settings: Settings;
  plan: SurveyOut | null;
  problem: string;
  set(settings: Settings): void;
  fly(): void;
}

export function useSurvey(
  flight: Flight | null,
  robot: string,
  height: number,
  config: RobotConfig | undefined,
): { survey: Survey | null; begin(): void } {
  const [area, setArea] = useState<Point[] | null>(null);
  const [settings, setSettings] = useState<Settings>({});
  const [answer, setAnswer] = useState<{ asked: string; plan: SurveyOut | null; problem: string } | null>(null);
  const name = useRef("");
  const asked = area && area.length > 2 ? JSON.stringify(requestOf(robot, area, settings, name.current)) : "";

  useEffect(() => {
    if (!flight || !asked) return;
    let gone = false;
    const timer = setTimeout(() => {
      ask<SurveyOut>(`v1/missions/${flight.mission.id}/survey`, JSON.parse(asked))
        .then((plan) => gone || setAnswer({ asked, plan, problem: "" }))
        .catch((error: unknown) => gone || setAnswer({ asked, plan: null, problem: messageOf(error) }));
    }, PAUSE);
    return () => {
      gone = true;
      clearTimeout(timer);
    };
  }, [flight, asked]);
  // Another drone is another survey.
  useEffect(() => setArea(null), [robot]);

  const { plan, problem } = answer?.asked === asked ? answer : { plan: null, problem: "" };
  const path = useMemo<Point[]>(() => plan?.waypoints.map((one) => [one.x, one.y]) ?? [], [plan]);
  const photos = plan?.photos?.places ?? NOWHERE;
  const begin = () => {
    // Of one column, map and form stand at the top.
    document.querySelector(".map")?.scrollIntoView({ block: "nearest" });
    name.current = `s${Date.now().toString(36).slice(-4)}`;
    setArea([]);
    const camera = surveyCamera(config);
    const how = camera ? byCamera(camera.id) : byView(viewOf(config));
    setSettings({ height: Number(height.toFixed(1)), ...how });
  };
  if (!flight || !area) return { survey: null, begin };
  const survey: Survey = {
    ...{ robot, config, area, path, photos, settings, plan, problem, refused: problem !== "" },
    add: (point) => area.length < CORNERS && setArea([...area, round(point)]),
    move: (corner, to) => setArea(area.map((one, place) => (place === corner ? round(to) : one))),
    undo: () => setArea(area.slice(0, -1)),
    cancel: () => setArea(null),
    set: (some) => setSettings({ ...settings, ...some }),
    fly: () => {
      const waypoints = plan?.waypoints ?? [];
      const last = waypoints.at(-1);
      if (!last) return;
      const list = waypoints as [Waypoint, ...Waypoint[]];
      flight.fly({ robot, waypoints: list }, `survey ${name.current}`, (status) => {
        const known = [...idsOf(aheadOf(status)), ...status.mission.visited];
        return known.includes(last.id) ? `its ${waypoints.length} waypoints are in the plan` : null;
      });
      setArea(null);
    },
  };
  return { survey, begin };
}

/** Degrees that a robot's first camera sees from side to side. */
function viewOf(config: RobotConfig | undefined): number {
  return camerasOf(config)[0]?.settings.horizontal_fov ?? FIELD_OF_VIEW;
}

function requestOf(robot: string, area: Point[], settings: Settings, name: string): SurveyIn {
  const corners = area.map(([east, north]) => [east, north]) as SurveyIn["area"];
  // A width, a camera or its field of view decide how far the lines lie apart.
  const view = settings.camera || settings.width ? { field_of_view: null } : {};
  return { robot, area: corners, name, ...settings, ...view };
}

/** A place to the centimetre. */
export function round([east, north]: Point): Point {
  return [Number(east.toFixed(2)), Number(north.toFixed(2))];
}

type NumberSetting = "height" | "ground_resolution" | "front_overlap" | "overlap" | "field_of_view" | "width" | "speed";

/** A setting that is a number, with how it is asked for. */
interface NumberField extends Omit<FieldProps, "value"> {
  setting: NumberSetting;
  /** How many of its unit on the page are one of the request's. */
  scale?: number;
}

const RESOLUTION_FIELD: NumberField = {
  setting: "ground_resolution",
  name: "resolution",
  label: "Resolution, cm/pixel",
  min: 0.05,
  max: 1000,
  step: "any",
  scale: 100,
};
const OVERLAPS: NumberField[] = [
  { setting: "front_overlap", name: "front", label: "Front overlap, %", min: 0, max: 95, step: "1", scale: 100 },
  { setting: "overlap", name: "side", label: "Side overlap, %", min: 0, max: 90, step: "1", scale: 100 },
];
const STRIPS: NumberField[] = [
  { setting: "field_of_view", name: "fov", label: "Field of view, °", min: 2, max: 170, scale: 1 / RADIANS },
  { setting: "overlap", name: "overlap", label: "Overlap, %", min: 0, max: 90, step: "1", scale: 100 },
  { setting: "width", name: "width", label: "Strip width, m", min: 0.1, optional: "automatic" },
];
const SPEED: NumberField = { setting: "speed", name: "speed", label: "Speed, m/s", min: 0.1, optional: "cruise" };

function SettingField({ survey, field }: { survey: Survey; field: NumberField }) {
  const { setting, scale = 1, ...rest } = field;
  const value = survey.settings[setting];
  const given = (text: string) => (text === "" ? null : Number(text) / scale);
  return (
    <Field
      {...rest}
      value={value == null ? "" : String(Number((value * scale).toFixed(2)))}
      onValue={(text) => survey.set({ [setting]: given(text) })}
    />
  );
}

export function SurveyPanel({ survey }: { survey: Survey }) {
  const { settings, plan, area, config } = survey;
  const { ceiling = CEILING, no_fly = [] } = config?.limits.geofence ?? {};
  const cameras = camerasOf(config).map(({ id }): [string, string] => [id, `by ${id}`]);
  const resolved = settings.ground_resolution != null;
  const height: NumberField = { setting: "height", name: "height", label: "Height, m", min: 0.5, max: ceiling };
  const fields = [resolved ? RESOLUTION_FIELD : height, ...(settings.camera ? OVERLAPS : STRIPS)];
  const byHeight = {
    height: settings.height ?? plan?.height ?? config?.limits.takeoff_height ?? 2,
    ground_resolution: null,
  };
  const chooseHeight = (by: string) =>
    survey.set(by === "height" ? byHeight : { height: null, ground_resolution: RESOLUTION });
  const chooseCamera = (camera: string) => {
    const how = resolved && camera ? {} : byHeight;
    survey.set({ ...how, ...(camera ? byCamera(camera) : byView(viewOf(config))) });
  };
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
          ? "Click the corners on the map, or press Enter at its cross. Backspace removes the last one."
          : "Drag corners to change them, click to add more."}
      </p>
      {cameras.length > 0 && (
        <label>
          <span>Pictures</span>
          <Select
            name="camera"
            value={settings.camera ?? ""}
            options={[["", "none"], ...cameras]}
            onChoose={chooseCamera}
          />
        </label>
      )}
      {settings.camera && (
        <label>
          <span>Planned by</span>
          <Select
            name="by"
            value={resolved ? "resolution" : "height"}
            options={[["height", "height"], ["resolution", "resolution"]]}
            onChoose={chooseHeight}
          />
        </label>
      )}
      {fields.map((field) => (
        <SettingField key={field.name} survey={survey} field={field} />
      ))}
      <Field
        name="direction"
        label="Direction, ° from north"
        value=""
        min={0}
        max={360}
        step="1"
        optional="shortest"
        onValue={(text) => survey.set({ angle: text === "" ? null : (90 - Number(text)) * RADIANS })}
      />
      <SettingField survey={survey} field={SPEED} />
      {no_fly.length > 0 && (
        <label class="check">
          <input
            type="checkbox"
            name="around"
            checked={settings.around ?? false}
            onChange={(event) => survey.set({ around: event.currentTarget.checked })}
          />
          <span>Fly around no-fly zones</span>
        </label>
      )}
      <Corners drawn={survey} />
      <Figures survey={survey} />
      <div class="buttons">
        <button type="submit" class="primary" disabled={plan === null}>Fly the survey</button>
        <Button disabled={area.length === 0} onClick={survey.undo}>Undo corner</Button>
        <Button onClick={survey.cancel}>Cancel</Button>
      </div>
    </form>
  );
}

/** The corners as numbers, for whoever uses no pointer or knows them. */
export function Corners({ drawn }: { drawn: Drawn }) {
  if (drawn.area.length === 0) return null;
  const set = (corner: number, axis: 0 | 1, value: number) => {
    const [east, north] = drawn.area[corner] ?? [0, 0];
    drawn.move(corner, axis === 0 ? [value, north] : [east, value]);
  };
  return (
    <details class="corners">
      <summary>{drawn.area.length} corners</summary>
      <ol>
        {drawn.area.map((point, corner) => (
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
      <p class="problem" role="alert" data-testid="survey-problem">{problem}</p>
    );
  }
  if (!plan) {
    return (
      <p class="hint" role="status">
        {area.length < 3 ? "An area has three corners or more." : "Planning…"}
      </p>
    );
  }
  const { photos, available, battery } = plan;
  const short = available !== null && battery > available;
  const percent = (charge: number) => `${(100 * charge).toFixed(0)} %`;
  const resolution = photos?.resolution;
  const figures: FigureProps[] = [
    { name: "Path", value: plan.length.toFixed(0), unit: "m" },
    { name: "Time", value: clock(plan.seconds), unit: "min" },
    { name: "Sweeps", value: String(plan.sweeps), unit: `of ${plan.width.toFixed(1)} m` },
    { name: "Battery", value: percent(battery), unit: "with return", tone: short ? "bad" : "" },
  ];
  if (photos) {
    figures.push(
      { name: "Pictures", value: String(photos.places.length) },
      { name: "One every", value: photos.interval.toFixed(1), unit: `s, ${photos.spacing.toFixed(1)} m` },
      { name: "Resolution", value: resolution == null ? null : (100 * resolution).toPrecision(2), unit: "cm/pixel" },
      { name: "Height", value: plan.height.toFixed(1), unit: "m" },
    );
  }
  return (
    <>
      <dl class="figures" data-testid="survey-plan" aria-live="polite">
        {figures.map((figure) => (
          <Figure key={figure.name} {...figure} />
        ))}
      </dl>
      {photos?.warning && (
        <p class="problem" role="alert" data-testid="survey-warning">{photos.warning}.</p>
      )}
      {short && (
        <p class="problem" role="alert">
          The battery has only {percent(available)} to spend: the drone will return before the end.
        </p>
      )}
    </>
  );
}
