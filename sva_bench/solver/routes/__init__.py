"""Routes searched: construction, ruin and recreate, refuelling."""
