# From a cyclic test of a damper to a model, and the energies that both dissipate in each cycle.
hysim example damper.csv --device damper
hysim columns damper.csv
hysim metrics damper.csv --cycles --csv measured.csv
hysim identify damper.csv --model bouc-wen --fix n=1.5 --to 60s --every 2 --out damper.json --plot fit.svg
hysim simulate damper.json damper.csv --out model.csv
hysim metrics model.csv --cycles --csv modelled.csv
hysim plot damper.csv --model damper.json --kind residual-map --out residuals.svg
