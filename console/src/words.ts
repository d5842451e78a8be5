// How the page writes names, times and directions.

/** A word of the wire as people read it. */
export function wordsOf(name: string): string {
  return name.replaceAll("_", " ");
}

/** Hours if there are any, minutes and seconds, with tenths if asked for: `1:05` or `1:05.3`. */
export function clock(seconds: number, tenths = false): string {
  const all = tenths ? Math.floor(10 * seconds) / 10 : Math.round(seconds);
  const pad = (part: number) => String(Math.floor(part)).padStart(2, "0");
  const [hours, minutes] = [Math.floor(all / 3600), Math.floor((all % 3600) / 60)];
  const rest = tenths ? `.${Math.round(10 * all) % 10}` : "";
  return `${hours ? `${hours}:${pad(minutes)}` : minutes}:${pad(all % 60)}${rest}`;
}

/** Seconds in one unit. */
export function lasting(seconds: number): string {
  if (seconds < 120) return `${seconds.toFixed(0)} s`;
  return seconds < 7200 ? `${(seconds / 60).toFixed(0)} min` : `${(seconds / 3600).toFixed(0)} h`;
}

/** Direction of a way, degrees clockwise from north in three digits. */
export function bearingOf(east: number, north: number): string {
  const degrees = Math.round((Math.atan2(east, north) * 180) / Math.PI + 360) % 360;
  return `${String(degrees).padStart(3, "0")}°`;
}
