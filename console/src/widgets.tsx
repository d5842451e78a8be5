// Small parts that all panels are made of: cards, badges, buttons, choices, figures, fields and keys.

import type { ComponentChildren } from "preact";
import { useLayoutEffect, useRef } from "preact/hooks";

/** Share of a battery below which it is shown as low. */
export const LOW = 0.3;

interface CardProps {
  /** Class of the card. */
  kind: string;
  label: string;
  /** Its heading, where that is not the label. */
  title?: string;
  /** What stands beside the heading. */
  head?: ComponentChildren;
  children: ComponentChildren;
}

export function Card({ kind, label, title = label, head, children }: CardProps) {
  return (
    <section class={`card ${kind}`} aria-label={label}>
      <header>
        <h2>{title}</h2>
        {head}
      </header>
      {children}
    </section>
  );
}

interface BadgeProps {
  tone?: string;
  testid?: string;
  /** Whether it is read out when it changes. */
  status?: boolean;
  children: ComponentChildren;
}

export function Badge({ tone = "", testid, status, children }: BadgeProps) {
  return (
    <span class={`badge ${tone}`} data-testid={testid} role={status ? "status" : undefined}>
      {children}
    </span>
  );
}

interface ButtonProps {
  children?: ComponentChildren;
  class?: string;
  title?: string;
  /** Its name, where its text is none. */
  label?: string;
  pressed?: boolean;
  disabled?: boolean;
  testid?: string;
  onClick(): void;
}

export function Button({ label, pressed, testid, onClick, ...rest }: ButtonProps) {
  return (
    <button
      type="button"
      aria-label={label}
      aria-pressed={pressed}
      data-testid={testid}
      onClick={() => onClick()}
      {...rest}
    />
  );
}

interface SelectProps {
  label?: string;
  name?: string;
  value: string;
  /** Value and text of each option. */
  options: [value: string, text: string][];
  onChoose(value: string): void;
}

export function Select({ label, name, value, options, onChoose }: SelectProps) {
  return (
    <select
      aria-label={label}
      name={name}
      value={value}
      onChange={(event) => onChoose(event.currentTarget.value)}
    >
      {options.map(([option, text]) => (
        <option key={option} value={option}>{text}</option>
      ))}
    </select>
  );
}

/** A choice of several names; nothing where there is but one. */
export function NameChoice({ names, ...rest }: { names: string[] } & Omit<SelectProps, "options">) {
  return names.length < 2 ? null : <Select options={names.map((name) => [name, name])} {...rest} />;
}

export interface FigureProps {
  name: string;
  /** Null or undefined where it is not known. */
  value: string | null | undefined;
  unit?: string;
  /** Share of a bar below it. */
  bar?: number | null;
  tone?: string;
  title?: string;
}

export function Figure({ name, value, unit, bar, tone, title }: FigureProps) {
  return (
    <div class="figure" title={title}>
      <dt>{name}</dt>
      <dd class={tone}>
        {value ?? "—"} {value != null && unit && <small>{unit}</small>}
        {bar != null && (
          <meter class={bar < LOW ? "low" : ""} min={0} max={1} value={bar} aria-label={name} />
        )}
      </dd>
    </div>
  );
}

export interface FieldProps {
  name: string;
  label: string;
  value: string;
  min?: number;
  max?: number;
  step?: string;
  /** What is meant where nothing is given. */
  optional?: string;
  first?: boolean;
  onValue?(value: string): void;
}

/** A number that is asked for. */
export function Field({ label, value, step = "0.1", optional, first, onValue, ...rest }: FieldProps) {
  return (
    <label>
      <span>{label}</span>
      <input
        type="number"
        inputMode="decimal"
        step={step}
        defaultValue={value}
        placeholder={optional}
        required={optional === undefined}
        autoFocus={first}
        onInput={({ currentTarget: { validity, value: given } }) => validity.valid && onValue?.(given)}
        {...rest}
      />
    </label>
  );
}

/** Call `listen` at each event of a kind, whatever has the focus. */
export function useEvent<K extends keyof WindowEventMap>(kind: K, listen: (event: WindowEventMap[K]) => void) {
  const newest = useRef(listen);
  newest.current = listen;
  useLayoutEffect(() => {
    const call = (event: WindowEventMap[K]) => newest.current(event);
    addEventListener(kind, call);
    return () => removeEventListener(kind, call);
  }, [kind]);
}

/** Call `act` when Escape is pressed, wherever the focus is; null while there is nothing to end. */
export function useEscape(act: (() => void) | null): void {
  useEvent("keydown", (event) => event.key === "Escape" && act?.());
}
