# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""How the status page looks: light and dark, on a phone and on paper."""

from __future__ import annotations

# Colours are told apart without seeing red or green, too (Okabe and Ito's palette), and never say anything alone.
STYLE = """
:root { color-scheme: light dark; --paper: #fff; --card: #f4f6f8; --ink: #16202a; --soft: #55626f; --line: #d5dbe1;
  --ok: #00694c; --warn: #8a5200; --bad: #b3261e; --link: #0b5cad; --track: #e6eaee;
  --c1: #0072b2; --c2: #e69f00; --c3: #009e73; --c4: #cc79a7; --c5: #56b4e9; --c6: #d55e00; --c7: #8a8f98; }
@media (prefers-color-scheme: dark) { :root { --paper: #12171c; --card: #1b222a; --ink: #e8edf2; --soft: #a4b0bc;
  --line: #37424d; --ok: #4cc79a; --warn: #f0b04a; --bad: #ff8a80; --link: #7cb8ff; --track: #2a333c; --c1: #4aa3df; } }
* { box-sizing: border-box; }
body { margin: 0 auto; padding: 1rem; max-width: 76rem; background: var(--paper); color: var(--ink);
  font: 16px/1.45 system-ui, "DejaVu Sans", sans-serif; overflow-wrap: anywhere; }
h1 { margin: 0; font-size: 1.6rem; } h2 { margin: 0; font-size: 1.15rem; display: inline; }
p { margin: .4rem 0; } a { color: var(--link); } time, .count, .soft, figcaption { color: var(--soft); }
.skip { position: absolute; left: -99rem; } .skip:focus { position: static; }
nav ul, .tiles, .wants, .legend { list-style: none; padding: 0; margin: .8rem 0; display: flex; flex-wrap: wrap; }
nav ul { gap: .2rem 1rem; } nav a { display: inline-block; padding: .3rem 0; }
.tiles { display: grid; grid-template-columns: repeat(auto-fit, minmax(9rem, 1fr)); gap: .6rem; }
.tiles a { display: block; height: 100%; padding: .6rem .8rem; border-radius: .5rem; background: var(--card);
  border-left: .35rem solid var(--soft); color: inherit; text-decoration: none; }
.tiles strong { display: block; font-size: 1.35rem; font-variant-numeric: tabular-nums; }
.tiles .ok { border-color: var(--ok); } .tiles .warn { border-color: var(--warn); }
.tiles .bad { border-color: var(--bad); }
.ok .mark { color: var(--ok); } .warn .mark { color: var(--warn); } .bad .mark { color: var(--bad); }
.mark { font-weight: 700; } .wants { display: block; }
.wants li { padding: .35rem .7rem; margin: .3rem 0; background: var(--card); border-left: .35rem solid var(--bad);
  border-radius: .3rem; } .wants .warn { border-color: var(--warn); }
section, figure { margin: 1.6rem 0; } summary { cursor: pointer; padding: .2rem 0; }
.plots { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(22rem, 100%), 1fr)); gap: 0 2.5rem; }
.plots figure { margin: 1rem 0; min-width: 0; } figcaption { margin-bottom: .6rem; }
figcaption strong { display: block; color: var(--ink); font-size: 1.05rem; }
table { border-collapse: collapse; width: 100%; font-size: .9rem; margin-top: .4rem; }
caption { position: absolute; left: -99rem; }
th, td { text-align: left; vertical-align: top; padding: .35rem .6rem; border-bottom: 1px solid var(--line);
  unicode-bidi: isolate; overflow-wrap: normal; }
.wide { overflow-x: auto; } td.long, th.long { overflow-wrap: anywhere; min-width: 11rem; }
thead th { color: var(--soft); font-weight: 600; border-bottom-width: 2px; }
tbody th { font-weight: 600; } tbody tr { border-left: .3rem solid transparent; }
tbody tr.warn { border-left-color: var(--warn); } tbody tr.bad { border-left-color: var(--bad); }
.number { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
svg.plot { display: block; overflow: hidden; } svg text { fill: var(--ink); font-size: 13px; }
svg .tick { stroke: var(--line); } svg text.tick { stroke: none; fill: var(--soft); font-size: 11px; }
svg .label, svg .value { paint-order: stroke; stroke: var(--paper); stroke-width: 4px; }
svg .track { fill: var(--track); } svg .spread { fill: var(--c5); opacity: .6; }
svg .value { font-variant-numeric: tabular-nums; }
.legend { gap: .2rem 1rem; font-size: .85rem; margin: .2rem 0; }
.legend svg { width: 12px; height: 12px; margin-right: .35rem; vertical-align: -1px; }
.c1 { fill: var(--c1); } .c2 { fill: var(--c2); } .c3 { fill: var(--c3); } .c4 { fill: var(--c4); }
.c5 { fill: var(--c5); } .c6 { fill: var(--c6); } .c7 { fill: var(--c7); }
@media (max-width: 48rem) {
  table, tbody, tr, td, tbody th { display: block; } thead { position: absolute; left: -99rem; }
  tbody tr { background: var(--card); border-radius: .4rem; margin: .5rem 0; padding: .35rem .5rem; display: flex;
    flex-wrap: wrap; gap: 0 1rem; }
  td, tbody th { border: 0; padding: .05rem 0; text-align: left; white-space: normal; min-width: 0;
    overflow-wrap: anywhere; }
  td.long, th.long { min-width: 0; } tbody th { order: -1; flex: 0 0 100%; } td.nothing { display: none; }
  td::before { content: attr(data-label) "\\a0"; color: var(--soft); }
}
@media print { body { max-width: none; } nav, .skip { display: none; } }
"""
